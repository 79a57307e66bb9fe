"""One view layer of one frame: Cycles renders batches of samples of the open tiles, and noisefloor says which
tiles stay open."""

import time

import bpy
import noisefloor
import numpy

from . import denoise, passes, sampling, settings
from .host import rectangles

SAMPLES, NOISE = "noisefloor Samples", "noisefloor Visible Noise"
NOISY, ALBEDO, NORMAL = "Noisy Image", "Denoising Albedo", "Denoising Normal"


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
        self.seed = (
            f"{seed} frame {self.scene.frame_current}" if self.scene.cycles.use_animated_seed else seed
        )
        self.film = self._film()
        self.session = noisefloor.Session(
            *self.size,
            settings.oracle(self.settings),
            settings.params(self.scene, sampling.BATCH, shown, self.film),
        )
        self.sums = passes.Sums(*self.size)
        self.begun, self.sampled = time.monotonic(), 0
        self.tiles = self.session.open_tiles
        # What the windows draw meanwhile, and how often it has changed
        self.shown, self.shows = numpy.zeros((*self.size[::-1], 4), numpy.float32), 0
        self.denoiser = self._denoiser(depsgraph) if self.scene.cycles.use_denoising else None

    def _film(self):
        """The frames per second of the animation that is rendered, whose noise is new in every frame; None for a
        still."""
        if not self.engine.is_animation:
            return None
        if not self.scene.cycles.use_animated_seed:
            self.engine.report(
                {"WARNING"},
                "All frames have the same seed: their noise stands still on the screen, and takes about three times "
                "the samples to vanish. Use Animated Seed (the clock beside Seed), so that noisefloor judges them as a film",
            )
            return None
        render = self.scene.render
        rate = render.fps / render.fps_base
        # What is slower is a row of stills
        return rate if rate >= 10 else None

    def _denoiser(self, depsgraph):
        """The library that denoises the picture; Cycles is told to render what it needs."""
        found = denoise.library()
        if found is None:
            self.engine.report(
                {"WARNING"}, "noisefloor does not denoise: this Blender has no Open Image Denoise"
            )
            return None
        if self.scene.cycles.denoising_input_passes != "RGB":
            depsgraph.view_layer_eval.cycles.denoising_store_passes = True
            rendered = self.engine.get_result().layers[self.layer].passes.keys()
            for name, channels in [(NORMAL, "XYZ"), (ALBEDO, "RGB")]:
                if name not in rendered:
                    self.engine.add_pass(name, 3, channels, layer=self.layer)
        return found

    def run(self, report):
        """Renders until every tile is done; calls report(frame) after each batch."""
        render, cycles = self.engine.render, self.scene.cycles
        border = [
            "use_border",
            "use_crop_to_border",
            "border_min_x",
            "border_max_x",
            "border_min_y",
            "border_max_y",
        ]
        # The evaluated scene is the same in the next frame of an animation, and in the next layer
        every = [prop.identifier for prop in cycles.bl_rna.properties if not prop.is_readonly]
        owned = [(render, name) for name in border] + [(cycles, name) for name in every]
        before = [(owner, name, getattr(owner, name)) for owner, name in owned]
        try:
            while not self.session.done:
                ended = self._round(report)
                if ended:
                    self.session.close_all(ended)
        finally:
            for owner, name, value in before:
                if getattr(owner, name) != value:
                    setattr(owner, name, value)

    def _round(self, report):
        """A batch of samples for each open tile, and verdicts on those that are due; returns why to end, if
        so."""
        # Tiles are open from the first round on, so they have samples alike
        requests = self.session.requests()
        tiles = [
            {
                "x": t.x,
                "y": t.y,
                "width": t.width,
                "height": t.height,
                "points": (request.sequence, request.point),
            }
            for request in requests
            for t in [request.tile]
        ]
        for region, (points,), members in rectangles(tiles, ["points"]):
            pictures = self._sample(region, points)
            if self._cancelled():
                return "cancelled"
            self.sums.add(region, sampling.BATCH, pictures)
            self.sampled += region[2] * region[3] * sampling.BATCH
            picture = numpy.ascontiguousarray(pictures["Combined"][..., :3])
            for member in members:
                tile = requests[member].tile
                x, y = tile.x - region[0], tile.y - region[1]
                self.session.push(tile, sampling.BATCH, picture[y : y + tile.height, x : x + tile.width])
            if not bpy.app.background:
                self._show(region)
            report(self)
            if 0 < self.settings.time_limit < time.monotonic() - self.begun:
                return "time-limit"
        self.session.judge()
        return None

    def _cancelled(self):
        """Whether Esc was hit: the last batch may be incomplete then."""
        return self.engine.test_break()

    def _sample(self, region, points):
        """A batch of samples; points: a sequence, and the first of it."""
        x, y, width, height = region
        # For motion blur, Cycles evaluates other frames, and settings that move are as in the file again
        cycles = self.depsgraph.scene_eval.cycles
        sampling.independent(cycles)
        sampling.choose(cycles, self.seed, *points, sampling.BATCH)
        sampling.aim(
            self.engine.render,
            (self.across, self.down),
            (x + self.corner[0], y + self.corner[1], width, height),
        )
        self.cycles()
        pictures = passes.read(self.engine, self.layer, (width, height))
        if NOISY in pictures:
            # Where Cycles was to denoise, it leaves the picture for that empty
            pictures["Combined"] = pictures[NOISY]
        return pictures

    def _show(self, region):
        """Brings the picture that people look at up to date."""
        x, y, width, height = region
        here = slice(y, y + height), slice(x, x + width)
        self.shown[here] = self.sums.sums["Combined"][here] / numpy.maximum(self.sums.samples[here], 1)
        self.shows += 1

    def finish(self):
        """Puts all passes into the result, with the two maps; returns the maps."""
        pictures = self.sums.means()
        if pictures:
            pictures["Combined"][..., :3] = self.session.image()
            if NOISY in pictures:
                pictures[NOISY] = pictures["Combined"].copy()
            if self.denoiser:
                guides = pictures.get(ALBEDO), pictures.get(NORMAL)
                pictures["Combined"][..., :3] = denoise.denoise(
                    self.denoiser, pictures["Combined"][..., :3], *guides
                )
        visible = self.session.visible_noise()
        if visible is None:
            visible = numpy.full(self.size[::-1], numpy.nan, numpy.float32)
        spp = self.session.spp()
        maps = {SAMPLES: spp, NOISE: numpy.nan_to_num(visible)}
        for name in maps:
            self.engine.add_pass(name, 1, "X", layer=self.layer)
        passes.write(self.engine, self.layer, {**pictures, **maps})
        return spp, visible

    def progress(self):
        """Share of the samples that are taken, and seconds left; None while unknown."""
        left = self.session.expected_samples
        if left is None:
            return None, None
        seconds = time.monotonic() - self.begun
        return self.sampled / max(self.sampled + left, 1), seconds * left / max(self.sampled, 1)

    def summary(self):
        """One line."""
        stops, spp = self.session.stops(), self.session.spp()
        done = sum(stop.reason == "converged" for stop in stops)
        reasons = {}
        for stop in stops:
            if stop.reason != "converged":
                reasons[stop.reason] = reasons.get(stop.reason, 0) + 1
        others = "".join(f"; {count} ended: {reason}" for reason, count in reasons.items())
        film = f", {self.film:g} frames a second" if self.film else ""
        seen = f"{self.settings.people:.0%} of people, {self.settings.viewing}{film}"
        return (
            f"{done} of {len(stops)} tiles without visible noise ({seen}), "
            f"{spp.min()} to {spp.max()} samples per pixel, {spp.mean():.0f} on average{others}; "
            f"{time.monotonic() - self.begun:.0f} s"
        )
