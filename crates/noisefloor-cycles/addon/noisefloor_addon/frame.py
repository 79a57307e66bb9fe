"""One view layer of one frame: Cycles renders pairs of pictures, by its own adaptive sampling, with thresholds that fall,
until nobody sees what is wrong with all of them together.

The threshold says where samples go, pixel by pixel; noisefloor says when they are enough, and in which squares of the
picture more are needed. Every sample counts in the end."""

import concurrent.futures
import math
import time

import bpy
import noisefloor
import numpy

from . import denoise, judging, passes, sampling
from .host import rectangles

SAMPLES, NOISE, LOST = "noisefloor Samples", "noisefloor Visible Noise", "noisefloor JOD Lost"
COUNT = "Debug Sample Count"
# Passes that Cycles denoises, with the letters of their channels, and what it calls them before
DENOISED = [("Combined", "RGBA", "Noisy Image"), ("Shadow Catcher", "RGB", "Noisy Shadow Catcher")]
COARSEST, FINEST = 0.2, 0.001
# Edge of the cells in which squares of 64 pixels that overlap by half meet
CELL = 32
# What is aimed at, as a share of what may be seen, and the least step towards it; as noisefloor.Search does
AIM, LEAST_STEP = 0.9, 1.25
# Fewer samples are not worth a call of Cycles, which looks at its threshold after 16
FEWEST = 16
# What a call costs a GPU, however small the part, in samples of each pixel of the frame: 36 and 40 on an H200 (docs/benchmarks/cost.md)
START = 32


def warn(engine, text):
    engine.report({"WARNING"}, f"noisefloor: {text}")


def film_rate(scene):
    """Frames per second, if the noise of an animation is new in every frame; None if it is not, or slower than a film."""
    rate = scene.render.fps / scene.render.fps_base
    return rate if scene.cycles.use_animated_seed and rate >= 10 else None


def clock(seconds):
    return f"{int(seconds) // 60}:{int(seconds) % 60:02}"


def cells(region):
    """The cells that a region has pixels of."""
    x, y, width, height = region
    return slice(y // CELL, -(-(y + height) // CELL)), slice(x // CELL, -(-(x + width) // CELL))


class Frame:
    """engine: Cycles' RenderEngine, which Blender has asked for a layer. cycles: renders what the evaluated
    scene says. shown: how the picture is displayed, see display.py.

    Only the evaluated scene and the engine's own copy of the render settings are changed, and changed back
    after the layer. No file, undo step or window ever sees them."""

    def __init__(self, engine, depsgraph, cycles, shown):
        self.engine, self.cycles, self.depsgraph = engine, cycles, depsgraph
        self.scene, self.layer = depsgraph.scene_eval, depsgraph.view_layer_eval.name
        self.settings = self.scene.noisefloor
        result = engine.get_result()
        self.size = result.resolution_x, result.resolution_y
        render = engine.render
        self.across = render.resolution_x * render.resolution_percentage // 100
        self.down = render.resolution_y * render.resolution_percentage // 100
        # A region of the user's own is a frame of its own
        left, top = 0, 0
        if render.use_border:
            left = int(render.border_min_x * self.across)
            top = self.down - int(render.border_min_y * self.down) - self.size[1]
        self.corner = left, top
        seed = self.scene.cycles.seed
        self.seed = f"{seed} frame {self.scene.frame_current}" if self.scene.cycles.use_animated_seed else seed
        self.film = self._film()
        self.fewest = self.scene.cycles.adaptive_min_samples
        self.denoises = self.scene.cycles.use_denoising and depsgraph.view_layer_eval.cycles.use_denoising
        catches = any(instance.object.is_shadow_catcher for instance in depsgraph.object_instances)
        self.judge = judging.Judge(self.scene, shown, self.film, self.denoises, catches)
        self.search = noisefloor.Search(threshold=(COARSEST, FINEST))
        self.halves = passes.Means(*self.size), passes.Means(*self.size)
        # The sum of 1/threshold² of the pictures that each cell has, and how far it is from what may be seen
        down, across = -(-self.size[1] // CELL), -(-self.size[0] // CELL)
        self.effort, self.ratio = numpy.zeros((down, across)), numpy.full((down, across), numpy.inf)
        # Samples of a pixel for each unit of that, on average, in each cell
        self.rate = numpy.zeros((down, across))
        self.on_gpu, self.stream = denoise.gpu(self.scene) is not None, ""
        self.excess, self.reason, self.thresholds = None, None, []
        # Samples, over all pixels, and how many of them are expected in the end
        self.begun, self.sampled, self.expected = time.monotonic(), 0, None
        # What the windows draw meanwhile, and how often it has changed
        self.shown, self.shows = passes.upright((*self.size[::-1], 4)), 0
        self._add_passes(depsgraph)

    def _film(self):
        """The frames per second of the animation that is rendered, whose noise is new in every frame; None for a
        still."""
        if not self.engine.is_animation:
            return None
        if not self.scene.cycles.use_animated_seed:
            warn(self.engine, "all frames have the same seed: their noise stands still on the screen, and takes about three times the "
                 "samples to vanish. Use Animated Seed (the clock beside Seed), so that they are judged as a film")
            return None
        return film_rate(self.scene)

    def _add_passes(self, depsgraph):
        """Cycles is told to render what denoising and the weights of pictures need."""
        layer, wanted = depsgraph.view_layer_eval.cycles, [(COUNT, 1, "X")]
        layer.pass_debug_sample_count = True
        if self.denoises and self.judge.library is None:
            warn(self.engine, "nothing is denoised, since this Blender has no Open Image Denoise")
        if self.judge.library and self.judge.guides:
            layer.denoising_store_passes = True
            wanted += [(judging.NORMAL, 3, "XYZ"), (judging.ALBEDO, 3, "RGB")]
        rendered = self.engine.get_result().layers[self.layer].passes.keys()
        for name, channels, letters in wanted:
            if name not in rendered:
                self.engine.add_pass(name, channels, letters, layer=self.layer)

    def run(self, report):
        """Renders until every square is done; calls report(frame) after each picture."""
        render, cycles = self.engine.render, self.scene.cycles
        # The evaluated scene is the same in the next frame of an animation, and in the next layer
        every = [prop.identifier for prop in cycles.bl_rna.properties if not prop.is_readonly]
        owned = [(render, name) for name in sampling.BORDER] + [(cycles, name) for name in every]
        before = [(owner, name, getattr(owner, name)) for owner, name in owned]
        try:
            while self.reason is None:
                self.reason = self._round(report)
        finally:
            for owner, name, value in before:
                if getattr(owner, name) != value:
                    setattr(owner, name, value)

    def _round(self, report):
        """Two more pictures of what is not good enough, and a verdict; returns why to end, if so."""
        each = self.search.next().each
        jobs = self._jobs(each)
        if not jobs:
            return "max-spp"
        parts = self._parts(jobs)
        self.thresholds.append(each)
        for half, means in enumerate(self.halves):
            for number, (region, threshold, samples) in enumerate(parts):
                left = 0.0
                if self.settings.time_limit > 0:
                    # A fair share of what is left, for this picture
                    left = self.settings.time_limit - (time.monotonic() - self.begun)
                    if left <= 0:
                        return "time-limit"
                    left /= (2 - half) * len(parts) - number
                # Parts that overlap must not get the same samples
                self.stream = f" part {number}" if self.on_gpu and number else ""
                pictures, counts = self._sample(region, half, threshold, samples, left)
                cancelled = self._cancelled()
                # The last picture may be incomplete then: better than none
                if not cancelled or not means.samples.any():
                    means.add(region, counts, pictures)
                    self.sampled += float(counts.sum())
                if cancelled:
                    return "cancelled"
                if not bpy.app.background:
                    self._show(region)
                report(self)
        for region, threshold, _ in parts:
            self.effort[cells(region)] += 1 / threshold**2
        return self._verdict()

    def _jobs(self, each):
        """What is rendered next: cells, each with a threshold and the most samples. With all that it has, the worst is then
        as good as after one picture with the threshold `each`; others get as much less as they are better."""
        jobs = []
        target, first = 1 / each**2, 0.5 / COARSEST**2
        for cell in zip(*numpy.nonzero(self.ratio > 1)):
            y, x = (int(place) * CELL for place in cell)
            width, height = min(CELL, self.size[0] - x), min(CELL, self.size[1] - y)
            samples = self._room((x, y, width, height))
            wanted = target
            if self.excess is not None and self.excess.ratio < math.inf:
                share = math.log(self.ratio[cell] / AIM) / math.log(self.excess.ratio / AIM)
                last = 1 / self.thresholds[-1] ** 2
                wanted = self.effort[cell] * max((target / last) ** share, LEAST_STEP)
                # In whole powers of two, so that neighbours are rendered in one call
                wanted = min(first * 2 ** math.ceil(math.log2(wanted / first) - 0.1), target)
            missing = wanted - self.effort[cell]
            if samples >= FEWEST and missing > 0:
                threshold = float(f"{missing**-0.5:.3g}")
                jobs.append(dict(x=x, y=y, width=width, height=height, threshold=threshold, samples=samples))
        return jobs

    def _room(self, region):
        """How many samples each half of a region may still get."""
        x, y, width, height = region
        here = slice(y, y + height), slice(x, x + width)
        return self.settings.max_samples // 2 - int(max(half.samples[here].max() for half in self.halves))

    def _parts(self, jobs):
        """What Cycles is called for: regions, each with a threshold and the most samples."""
        parts = [(region, *values) for region, values, _ in rectangles(jobs, ["threshold", "samples"])]
        if not self.on_gpu:
            return parts
        # A GPU is faster with one region around two, and the finer threshold, than with a call for each
        joined = []
        for part in parts:
            while True:
                best, saved = None, 0
                for other in joined:
                    both = self._around(part, other)
                    if both[2] >= FEWEST:
                        saves = self._cost(part) + self._cost(other) - self._cost(both)
                        best, saved = ((other, both), saves) if saves > saved else (best, saved)
                if best is None:
                    break
                joined.remove(best[0])
                part = best[1]
            joined.append(part)
        return joined

    def _around(self, one, other):
        """The part around two."""
        (left, top, width, height), (x, y, across, down) = one[0], other[0]
        right, bottom = max(left + width, x + across), max(top + height, y + down)
        left, top = min(left, x), min(top, y)
        region = left, top, right - left, bottom - top
        return region, min(one[1], other[1]), self._room(region)

    def _cost(self, part):
        """What a part takes a GPU, in samples: as many for its threshold as its pixels had for those before."""
        region, threshold, most = part
        here = cells(region)
        least = sampling.least(self.fewest, threshold, most)
        samples = numpy.clip(self.rate[here] / threshold**2, least, most).sum() * CELL**2
        return START * self.size[0] * self.size[1] + samples

    def _verdict(self):
        """What is wrong where; returns why to end, if so."""
        self.excess = self.judge.excess([half.means for half in self.halves])
        self.ratio[:] = 0
        for x, y, width, height, ratio in self.excess.squares():
            here = cells((x, y, width, height))
            self.ratio[here] = numpy.maximum(self.ratio[here], ratio)
        if self.excess.ratio <= 1:
            return "found"
        # All samples together are the picture
        self.search.tell(self.excess.ratio, alone=self.excess.ratio)
        if self.on_gpu:
            known = sum(half.samples for half in self.halves)[..., 0] / 2
            rows, columns = (numpy.arange(0, side, CELL) for side in known.shape)
            summed = numpy.add.reduceat(numpy.add.reduceat(known, rows, 0), columns, 1)
            self.rate = summed / CELL**2 / numpy.maximum(self.effort, 1)
        # What fails by so much needs the square of that as many samples, as far as it is noise
        spp = sum(half.samples for half in self.halves)[..., 0]
        times = numpy.kron(numpy.clip(self.ratio, 1, 1e3) ** 2, numpy.ones((CELL, CELL)))
        self.expected = float((spp * times[: self.size[1], : self.size[0]]).sum())
        return self.search.ending

    def _cancelled(self):
        """Whether Esc was hit."""
        return self.engine.test_break()

    def _sample(self, region, half, threshold, samples, seconds):
        """One picture of a region, by Cycles' adaptive sampling: its passes, and the samples of each pixel."""
        x, y, width, height = region
        # For motion blur, Cycles evaluates other frames, and settings that move are as in the file again
        cycles = self.depsgraph.scene_eval.cycles
        seed = sampling.seed_of(f"{self.seed} half {half} round {len(self.thresholds)}{self.stream}")
        sampling.adapt(cycles, seed, threshold, samples)
        cycles.time_limit = seconds
        part = x + self.corner[0], y + self.corner[1], width, height
        sampling.aim(self.engine.render, (self.across, self.down), part)
        self.cycles()
        pictures = passes.read(self.engine, self.layer, (width, height))
        return pictures, sampling.counts(pictures.pop(COUNT), self.fewest, threshold, samples)

    def _show(self, region):
        """Brings the picture that people look at up to date."""
        x, y, width, height = region
        here = slice(y, y + height), slice(x, x + width)
        first, second = self.halves
        if second.means:
            share = second.samples[here] / numpy.maximum(first.samples[here] + second.samples[here], 1)
            passes.blend(*(half.means["Combined"][here] for half in self.halves), share, self.shown[here])
        else:
            self.shown[here] = first.means["Combined"][here]
        self.shows += 1

    def finish(self):
        """Puts all passes into the result, with the two maps; returns the maps."""
        both = passes.Means.joined(*self.halves)
        pictures, spp = both.means, both.samples[..., 0]
        if pictures and self.denoises:
            for name, letters, noisy in DENOISED:
                if name in pictures:
                    pictures[noisy] = pictures[name]
                    self.engine.add_pass(noisy, len(letters), letters, layer=self.layer)
        with concurrent.futures.ThreadPoolExecutor(1) as beside:
            # One thread says what is lost where, while the others denoise, or a GPU does
            left = beside.submit(self.excess.map if self.excess else lambda: numpy.full(self.size[::-1], numpy.nan, numpy.float32))
            if pictures and self.judge.library:
                pictures["Combined"] = self.judge.denoise(pictures)
                if "Shadow Catcher" in pictures:
                    pictures["Shadow Catcher"] = self.judge.denoise_alone(pictures["Shadow Catcher"])
            left = left.result()
        pictures[COUNT] = spp / max(spp.max(), 1)
        maps = {SAMPLES: spp, LOST if self.judge.library else NOISE: numpy.nan_to_num(left)}
        for name in maps:
            self.engine.add_pass(name, 1, "X", layer=self.layer)
        passes.write(self.engine, self.layer, {**pictures, **maps})
        return spp, left

    def progress(self):
        """Share of the samples that are taken, and seconds left; None while unknown."""
        if self.expected is None:
            return None, None
        seconds, left = time.monotonic() - self.begun, max(self.expected - self.sampled, 0.0)
        return min(self.sampled / self.expected, 1.0), seconds * left / max(self.sampled, 1)

    def summary(self):
        """One line."""
        spp = sum(half.samples for half in self.halves)
        squares = [ratio for *_, ratio in self.excess.squares()] if self.excess else []
        done = sum(ratio <= 1 for ratio in squares)
        ended = "" if self.reason == "found" else f"; ended: {self.reason}"
        what = "anything wrong" if self.judge.library else "visible noise"
        thresholds = ", ".join(f"{threshold:.3g}" for threshold in self.thresholds)
        return (
            f"{done} of {len(squares)} squares without {what} ({self.judge.said()}), "
            f"{spp.min():.0f} to {spp.max():.0f} samples per pixel, {spp.mean():.0f} on average, "
            f"thresholds {thresholds}{ended}; {time.monotonic() - self.begun:.0f} s"
        )
