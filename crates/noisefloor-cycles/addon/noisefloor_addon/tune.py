"""Find Noise Threshold: the setting of Cycles' own adaptive sampling at which nobody sees noise.

Cycles renders two pictures of different seeds with a coarse threshold, noisefloor says how far their mean is from what
people would see, and the next threshold follows, until it passes. Then the threshold is written into the scene, as if it
had been typed: Blender renders as ever, on any device, on any farm."""

import math
import time

import bpy
import noisefloor
import numpy

from . import compositor, denoise, display, frame, hooks, judging, sampling

ENDINGS = {
    "at-finest": "even the finest threshold tried is not enough",
    "unchanged": "a finer threshold changes nothing",
    "capped": "what is wrong is in pixels that reach Max Samples: raise it, or turn caustics off",
    "not-falling": "more samples do not help: what is wrong is no noise",
}
# As many as noisefloor.Search asks for at the most, and its longest step, in thresholds
CROPS, LEAP = 4, 0.25


class Search:
    """A search, picture by picture: whoever renders calls advance() before the first and after each. Settings of the scene are
    borrowed while a picture is rendered, and given back."""

    def __init__(self, scene):
        # The layer that people see first stands for the frame
        first = next((layer for layer in scene.view_layers if layer.use), None)
        self.scene, self.denoised = scene, scene.cycles.use_denoising and first and first.cycles.use_denoising
        if self.denoised and denoise.library() is None:
            raise ValueError("this Blender has no Open Image Denoise: turn Denoise off")
        self.before, self.frames, self.film = scene.frame_current, [scene.frame_current], None
        if scene.noisefloor.frames == "markers":
            marked = {marker.frame for marker in scene.timeline_markers}
            self.frames = sorted(marked & set(range(scene.frame_start, scene.frame_end + 1)))
            if not self.frames:
                raise ValueError("no frame between the first and the last is marked: add markers in the timeline")
            self.film = frame.film_rate(scene)
        catches = any(each.is_shadow_catcher for each in bpy.data.objects)
        self.judge = judging.Judge(scene, display.table(scene), self.film, self.denoised, catches)
        shot = scene.render
        self.size = tuple(side * shot.resolution_percentage // 100 for side in (shot.resolution_x, shot.resolution_y))
        # A region of the user's own is a picture of its own, and small
        # To a GPU, a part costs about what the whole does
        whole = shot.use_border or denoise.gpu(scene)
        thresholds, size = (frame.COARSEST, frame.FINEST), None if whole else self.size
        self.search = noisefloor.Search(threshold=thresholds, views=len(self.frames), size=size)
        # What is rendered next; and how hard the hardest frames are, with the whole pictures that crops may be cut from
        self.look, self.whole, self.pictures, self.begun = None, {}, [], 0.0
        self.running, self.done = self._run(), False
        # Seconds so far, and of a sample, by the last picture, with its threshold, the samples of its pixels, and the fewest
        self.spent, self.pace, self.counted, self.stopped = 0.0, None, None, False
        # The fewest samples of a pixel: of each picture, of one that is as good as both, and as they were set
        self.fewest = None
        # Cycles loads the scene once for all of them
        self.borrowed, self.persistent = [], shot.use_persistent_data
        shot.use_persistent_data = True

    def advance(self):
        """Goes on to where the next picture is to be rendered, with what it takes borrowed, or to the end."""
        self.done = next(self.running, "end") == "end"

    def _run(self):
        """The search, which yields where Blender is to render."""
        for self.look in self.search:
            if self.look.is_rendered:
                x, y, width, height = self.look.crop
                here = slice(y, y + height), slice(x, x + width)
                whole = self.whole[self.look.view][1]
                self._tell([{name: each[here] for name, each in picture.items()} for picture in whole])
                continue
            if self.counted and (self.look.crop or self.look.each != self.counted[0]):
                self.whole = {}
            for _ in range(2):
                self.borrow()
                yield
                self.pictures.append(self.take())
            pictures, self.pictures = self.pictures, []
            excess = self._tell(pictures)
            if self.look.crop is None:
                self.whole[self.look.view] = excess.ratio, pictures
                # So many crops lie in so many frames at the most
                if len(self.whole) > CROPS:
                    del self.whole[min(self.whole, key=lambda view: self.whole[view][0])]
        self.look, self.whole = None, {}

    def borrow(self):
        """What the next picture is rendered with."""
        scene, layers = self.scene, self.scene.view_layers
        if scene.frame_current != self.frames[self.look.view]:
            scene.frame_set(self.frames[self.look.view])
        cycles, shot = scene.cycles, scene.render
        # Both pictures together have the samples of one whose threshold is finer by √2, also where pixels have the fewest
        self.fewest = self.fewest_of(self.look.each)
        setting = self.fewest[2]
        wanted = [
            (scene.noisefloor, "use", False),
            (cycles, "use_adaptive_sampling", True),
            (cycles, "adaptive_threshold", self.look.each),
            (cycles, "adaptive_min_samples", setting),
            (cycles, "seed", (cycles.seed * 2 + len(self.pictures) + 1) % 2**31),
            (cycles, "use_animated_seed", False),
            (cycles, "use_denoising", False),
            (scene.render, "use_compositing", False),
            (scene.render, "use_sequencer", False),
        ]
        wanted += [(layer.cycles, "pass_debug_sample_count", True) for layer in layers]
        if self.denoised:
            wanted += [(layer.cycles, "denoising_store_passes", bool(self.judge.guides)) for layer in layers]
        owned = [(group, name) for group, name, _ in wanted] + [(shot, name) for name in sampling.BORDER]
        self.borrowed = [(group, name, getattr(group, name)) for group, name in owned]
        for group, name, value in wanted:
            setattr(group, name, value)
        if self.look.crop:
            sampling.aim(shot, self.size, self.look.crop)
        # A render that was stopped may have left some
        hooks.state.wanted = {name: value for group, name, value in wanted if group is cycles}
        hooks.state.rendered = {}
        self.begun = time.monotonic()

    def give_back(self):
        """Settings as they were."""
        hooks.state.wanted = None
        for group, name, value in self.borrowed:
            setattr(group, name, value)
        self.borrowed = []

    def end(self):
        """The frame that was shown before, and nothing kept of the scene."""
        self.give_back()
        self.scene.render.use_persistent_data = self.persistent
        if self.scene.frame_current != self.before:
            self.scene.frame_set(self.before)

    def take(self):
        """The picture that was rendered."""
        rendered, hooks.state.rendered = hooks.state.rendered, {}
        self.give_back()
        if not rendered:
            raise ValueError("nothing was rendered; is there a view layer that is used for rendering?")
        picture = next(iter(rendered.values()))
        cycles = self.scene.cycles
        limits = self.fewest[2], self.look.each, cycles.samples
        picture[frame.COUNT] = sampling.counts(picture[frame.COUNT], *limits)
        seconds = time.monotonic() - self.begun
        self.spent += seconds
        self.counted = self.look.each, picture[frame.COUNT], self.fewest[0]
        self.pace = seconds / self.counted[1].sum()
        return picture

    def _tell(self, pictures):
        """Judges two pictures, and tells the search."""
        counts = (picture[frame.COUNT][..., 0] for picture in pictures)
        excess = self.judge.excess(pictures, (*counts, *self.fewest[:2], self.scene.cycles.samples))
        self.search.tell(excess)
        return excess

    def fewest_of(self, each):
        """The fewest samples of a pixel of each of two pictures, of one that is as good as both, and what is set for them."""
        single = self.fewest_of_one(each / math.sqrt(2))
        half, setting = sampling.half(single)
        return half, single, setting

    def fewest_of_one(self, threshold):
        """Samples of a pixel of a picture with the user's own settings and this threshold."""
        cycles = self.scene.cycles
        return sampling.least(cycles.adaptive_min_samples, threshold, cycles.samples)

    def samples(self, threshold, few, crop):
        """What a picture will take, over all its pixels: where they have more than the fewest samples, these follow the
        threshold."""
        each, counts, fewest = self.counted
        following = numpy.minimum(counts * (each / threshold) ** 2, self.scene.cycles.samples)
        mean = float(numpy.where(counts > fewest, numpy.maximum(following, few), few).mean())
        return mean * (crop[2] * crop[3] if crop else self.size[0] * self.size[1])

    def left(self):
        """Seconds until the search has ended, at about, if noise falls as noise does; None if nothing is known."""
        if self.counted is None or self.look is None:
            return None
        each, crop, samples = self.look.each, self.look.crop, 0.0
        ratio = self.search.steps[-1][1] * each / math.sqrt(2) / self.search.steps[-1][0] if self.search.steps else 1.0
        pictures = 2 - len(self.pictures)
        while True:
            samples += pictures * self.samples(each, self.fewest_of(each)[0], crop)
            if not frame.AIM < ratio < math.inf or each <= frame.FINEST:
                break
            finer = max(frame.AIM / ratio, LEAP)
            each, ratio, pictures = max(each * finer, frame.FINEST), ratio * finer, 2
        if crop:
            # In the end, the whole
            samples += 2 * self.samples(each, self.fewest_of(each)[0], None)
        return self.pace * samples

    def share(self):
        """How much of that has passed."""
        left = self.left()
        return 0.0 if left is None else self.spent / max(self.spent + left, 1e-9)

    def status(self):
        """One line on how far it is."""
        steps, left = self.search.steps, self.left()
        text = f"noisefloor: picture {len(self.pictures) + 1} of 2"
        if self.look and self.look.crop:
            text += " of a part"
        if self.look and len(self.frames) > 1:
            text += f" of frame {self.frames[self.look.view]}"
        if steps:
            text += f"; {steps[-1][0]:.3g} leaves {steps[-1][1]:.2f} times what may be seen"
        if left is not None:
            text += f"; about {frame.clock(left)} left"
        return text

    def finish(self):
        """Writes what was found into the scene; returns what it says."""
        if self.search.setting is None:
            raise ValueError(ENDINGS[self.search.ending])
        setting, cycles = self.search.setting, self.scene.cycles
        cycles.use_adaptive_sampling, cycles.adaptive_threshold = True, setting
        people = (
            "nobody would see what is wrong with the denoised picture, by the vision model"
            if self.denoised
            else f"{self.scene.noisefloor.people:.0%} of people see no noise"
        )
        if len(self.frames) > 1:
            people += f", frame {self.frames[self.search.views[0]]} is the hardest of {len(self.frames)}"
        if self.film:
            people += f", at {self.film:g} frames a second"
        people += f"; about {self.seconds(setting):.0f} s a frame"
        hooks.state.tried[self.scene.name] = self.tried()
        if self.is_animated():
            people += "; Noise Threshold has keys or a driver, which will set it otherwise: remove them"
        if compositor.denoises(self.scene) and not self.denoised:
            people += f"; {compositor.ADVICE}"
        return f"{setting:.3g}: {people}"

    def seconds(self, setting):
        """What a frame will take."""
        return self.pace * self.samples(setting, self.fewest_of_one(setting), None)

    def tried(self):
        """Thresholds with what one picture leaves, over what may be seen, and its seconds, and whether it is the one that was
        found: from coarse to fine."""
        steps = sorted(self.search.steps)
        if all(setting != self.search.setting for setting, _ in steps):
            # Along the line between those that were looked at, in logarithms
            logs = numpy.log(numpy.maximum(steps, 1e-9))
            ratio = math.exp(numpy.interp(math.log(self.search.setting), *logs.T))
            steps = sorted([*steps, (self.search.setting, ratio)])
        return [(*step, self.seconds(step[0]), step[0] == self.search.setting) for step in reversed(steps)]

    def is_animated(self):
        """Whether keys or a driver set the threshold otherwise than it was found."""
        cycles, written = self.scene.cycles, self.scene.cycles.adaptive_threshold
        self.scene.frame_set(self.scene.frame_current)
        animated, cycles.adaptive_threshold = cycles.adaptive_threshold != written, written
        return animated


class RENDER_OT_noisefloor_threshold(bpy.types.Operator):
    """Render small steps until people stop seeing noise, and set Cycles' noise threshold to what that took"""

    bl_idname = "render.noisefloor_threshold"
    bl_label = "Find Noise Threshold"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        scene = context.scene
        return scene.render.engine == "CYCLES" and scene.camera is not None

    def execute(self, context):
        """All at once: without windows, and from scripts."""
        try:
            self.search = search = Search(context.scene)
            try:
                search.advance()
                while not search.done:
                    bpy.ops.render.render()
                    search.advance()
                    print(search.status(), flush=True)
            finally:
                search.end()
            self.tell()
        except (ValueError, noisefloor.Error) as error:
            return self.fail(error)
        return {"FINISHED"}

    def fail(self, error):
        self.report({"ERROR"}, f"noisefloor: {error}")
        return {"CANCELLED"}

    def tell(self):
        hooks.state.summary = self.search.finish()
        self.report({"INFO"}, hooks.state.summary)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        try:
            self.search = hooks.state.search = Search(context.scene)
        except (ValueError, noisefloor.Error) as error:
            return self.fail(error)
        self.timer = context.window_manager.event_timer_add(0.25, window=context.window)
        context.window_manager.modal_handler_add(self)
        self.search.advance()
        self.start(context)
        return {"RUNNING_MODAL"}

    def start(self, context):
        hooks.state.ended = None
        context.workspace.status_text_set(self.search.status() + "; Esc stops")
        bpy.ops.render.render("INVOKE_DEFAULT")

    def modal(self, context, event):
        if event.type != "TIMER" or hooks.state.ended is None:
            return {"PASS_THROUGH"}
        for area in context.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
        try:
            if hooks.state.ended == "cancelled" or self.search.stopped:
                return self.end(context, {"CANCELLED"})
            self.search.advance()
            if not self.search.done:
                self.start(context)
                return {"RUNNING_MODAL"}
            self.tell()
            return self.end(context, {"FINISHED"})
        except (ValueError, noisefloor.Error) as error:
            return self.end(context, self.fail(error))

    def end(self, context, how):
        hooks.state.search = None
        self.search.end()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        return how


class RENDER_OT_noisefloor_stop(bpy.types.Operator):
    """Stop the search after the picture that is being rendered; Esc stops that, too. All is as before"""

    bl_idname = "render.noisefloor_stop"
    bl_label = "Stop"

    @classmethod
    def poll(cls, context):
        return hooks.state.search is not None and not hooks.state.search.stopped

    def execute(self, context):
        hooks.state.search.stopped = True
        return {"FINISHED"}


def estimate(scene):
    """What a search will take, in words."""
    last = hooks.state.took.get(scene.name)
    about = f", about {frame.clock(last)} to {frame.clock(5 * last)}" if last else ""
    return f"Takes one to five frames{about}"


def draw_bar(row, share, text):
    if hasattr(row, "progress"):  # Blender 4 and later
        row.progress(factor=share, text=text)
    else:
        row.label(text=text)


def draw_tried(column, scene):
    """What a finer or a coarser threshold would leave, and take: bars are as long as a frame takes."""
    tried = hooks.state.tried.get(scene.name, [])
    longest = max((seconds for _, _, seconds, _ in tried), default=0)
    for setting, ratio, seconds, found in tried:
        left = f"{ratio * scene.noisefloor.lost:.2f} JOD lost" if scene.cycles.use_denoising else f"{ratio:.2f} of what may be seen"
        draw_bar(column, seconds / max(longest, 1e-9), f"{setting:.3g}: {left}, {seconds:.0f} s{' (found)' if found else ''}")


def draw(panel, context):
    """Beside Cycles' own field: for a still the loop first, for an animation the search."""
    scene = context.scene
    column = panel.layout.column()
    column.prop(scene.noisefloor, "use", text="Still: Render until nobody sees noise")
    if not scene.cycles.use_adaptive_sampling:
        return
    search = hooks.state.search
    row = column.row(align=True)
    if search is None:
        row.operator(RENDER_OT_noisefloor_threshold.bl_idname, text="Animation: Find Noise Threshold", icon="VIEWZOOM")
        column.label(text=estimate(scene))
        if scene.timeline_markers:
            column.prop(scene.noisefloor, "frames")
        draw_tried(column, scene)
    else:
        draw_bar(row, search.share(), search.status().removeprefix("noisefloor: "))
        row.operator(RENDER_OT_noisefloor_stop.bl_idname, text="", icon="X")
    if compositor.denoises(scene) and not scene.cycles.use_denoising:
        column.label(text=compositor.ADVICE[0].upper() + compositor.ADVICE[1:], icon="INFO")
