"""How the add-on gets into Cycles: its render of a layer is replaced where the panel's box is ticked, and
nothing else.

F12, Render Animation, menus and the command line all end in the method `render` of Cycles' RenderEngine, in
which Python calls Cycles. Calling it again and again, with other settings in the evaluated copy of the
scene, is what Blender itself does for several layers, if Persistent Data is on. An engine of our own would
lose Cycles' panels; an operator over F12 would block the window, show every batch, and be unknown to the
command line.
"""

import os
import threading
import time
import traceback

import bpy
import gpu
import noisefloor
import numpy
from bpy.app.handlers import persistent
from gpu_extras.presets import draw_texture_2d

from . import compositor, display, maps, passes
from .frame import Frame, clock, warn

original = {}
# By which Blender, too, knows that a file has been named in full, beside its own
SUFFIXES = {".jpg": [".jpg", ".jpeg"], ".tif": [".tif", ".tiff"]}


class State:
    """What the threads that render tell the one with the windows."""

    def __init__(self):
        self.lock = threading.Lock()
        self.status, self.images, self.summary, self.still = None, {}, "", None
        self.rendering = self.written = False
        self.borrowed = self.frame = self.texture = None
        # How the picture is displayed
        self.shown = None
        # The thread that is about to ask which passes a render has, and of which scene, if that render is ours
        self.registering = None
        # Of a search for the threshold: Cycles' settings by which pictures are wanted, those of each layer, and how a render
        # ended; the search that is in progress in a window; and what the last one of each scene has tried
        self.wanted, self.rendered, self.ended, self.search, self.tried = None, {}, None, None, {}
        # Seconds of the last frame of each scene, when what is rendered began, and frames since
        self.took, self.begun, self.frames = {}, 0.0, 0


state = State()


def wanted(engine, depsgraph):
    return not engine.is_preview and depsgraph.scene_eval.noisefloor.use


def update_render_passes(engine, scene, layer):
    """The passes that a render will have. Ours denoises afterwards. Cycles, told not to denoise, merges the noisy passes of a
    layer with those that it would denoise, and then leaves shadow catchers out of both."""
    if state.registering != (threading.get_ident(), scene.name):
        return original["update_render_passes"](engine, scene, layer)
    import cycles

    for name, channels, kind in cycles.engine.list_render_passes(scene, layer):
        if name not in passes.NOISY:
            engine.register_pass(scene, layer, name, len(channels), channels, kind)
    return None


def update(engine, data, depsgraph):
    """Before each layer. A session of ours must not show its batches, and one of Cycles' own has to show
    them."""
    state.registering = None
    on = wanted(engine, depsgraph)
    if engine.session and getattr(engine, "noisefloor", False) != on:
        original["free"](engine)
        engine.session = None
    engine.noisefloor = on
    _headless(on or bpy.app.background)
    try:
        original["update"](engine, data, depsgraph)
    finally:
        _headless(bpy.app.background)


def draw(engine, context, depsgraph):
    """While it renders, the Image Editor asks the engine for the picture, not the Render Result."""
    frame = state.frame
    if frame is None:
        return original["draw"](engine, context, depsgraph)
    if frame.shows == 0:
        return
    if state.texture is None or state.texture[0] != (id(frame), frame.shows):
        height, width = frame.shown.shape[:2]
        data = gpu.types.Buffer(
            "FLOAT", width * height * 4, numpy.ascontiguousarray(frame.shown[::-1]).ravel()
        )
        state.texture = (
            (id(frame), frame.shows),
            gpu.types.GPUTexture((width, height), format="RGBA16F", data=data),
        )
    texture = state.texture[1]
    draw_texture_2d(texture, (0, 0), texture.width, texture.height)


def render(engine, depsgraph):
    if not wanted(engine, depsgraph):
        if not state.wanted or engine.is_preview:
            return original["render"](engine, depsgraph)
        # A driver or keys may have set them otherwise
        for name, value in state.wanted.items():
            setattr(depsgraph.scene_eval.cycles, name, value)
        # Cycles frees what it has evaluated
        layer = depsgraph.view_layer_eval.name
        original["render"](engine, depsgraph)
        if not engine.test_break():
            result = engine.get_result()
            size = result.resolution_x, result.resolution_y
            pictures = passes.read(engine, layer, size)
            state.rendered[layer] = {name: picture.copy() for name, picture in pictures.items()}
        return None
    if not engine.render.use_persistent_data or engine.render.use_multiview:
        what = "stereo pictures" if engine.render.use_multiview else "scenes rendered for another scene"
        warn(engine, f"Cycles renders {what} by its own sampling settings")
        return original["render"](engine, depsgraph)
    try:
        _render(engine, depsgraph)
    except Exception as error:
        traceback.print_exc()
        engine.report({"ERROR"}, f"noisefloor: {error}")
    finally:
        state.frame = None


def _render(engine, depsgraph):
    def cycles():
        update(engine, bpy.data, depsgraph)
        original["render"](engine, depsgraph)

    # Cycles reads its settings anew only if something of the scene has changed: here the camera has, to the
    # same. Everything else has been read when the layer began
    depsgraph.update()
    depsgraph.scene_eval.camera.update_tag(refresh={"OBJECT"})
    frame = state.frame = Frame(engine, depsgraph, cycles, state.shown)
    if frame.judge.note:
        warn(engine, frame.judge.note)
    if compositor.denoises(depsgraph.scene) and not frame.denoises:
        warn(engine, compositor.ADVICE)

    def report(frame):
        text, share = _progress(frame)
        state.status = text
        engine.update_stats("noisefloor", text)
        if share is not None:
            engine.update_progress(share)

    error, state.status = None, "noisefloor: the first picture"
    try:
        frame.run(report)
    except Exception as caught:  # what there is, is kept
        error = caught
        frame.reason = "failed"
    spp, left = frame.finish()
    summary = frame.summary()
    engine.get_result().stamp_data_add_field(f"noisefloor.{frame.layer}", summary)
    print(f"noisefloor: {frame.layer}, frame {frame.scene.frame_current}: {summary}", flush=True)
    pictures = {"samples": maps.samples_map(spp), **maps.left_map(left, frame.judge.library, frame.settings)}
    # An evaluated scene can have only the layer that is rendered
    many = sum(layer.use for layer in depsgraph.scene.view_layers) > 1
    with state.lock:
        state.summary = summary
        for name, picture in pictures.items():
            state.images[f"noisefloor {name}" + (f", {frame.layer}" if many else "")] = picture
    if frame.settings.write_maps:
        stem = output(frame.scene, engine.is_animation) + (f"-{frame.layer}" if many else "")
        os.makedirs(os.path.dirname(stem) or ".", exist_ok=True)
        for name, picture in pictures.items():
            # Blender's own images are out of bounds in this thread
            noisefloor.write(f"{stem}-{name.replace(' ', '-')}.png", picture, encoding="srgb")
        with open(f"{stem}-noisefloor.txt", "w", encoding="utf-8") as file:
            file.write(summary + "\n")
    if error:
        try:
            raise error
        finally:
            error = None  # or the engine, and all that Cycles has loaded, outlives the render with it


def _progress(frame):
    share, left = frame.progress()
    spp = frame.sampled // (frame.size[0] * frame.size[1])
    text = f"noisefloor: {spp:.0f} samples per pixel"
    if frame.excess:
        text += f", {frame.excess.ratio:.2f} times what may be seen in the worst place"
    if left is not None:
        text += f", about {clock(left)} left"
    return text, share


def output(scene, animated):
    """Path of the rendered frame without its extension; movies have one file for all frames."""
    stem, suffix = os.path.splitext(bpy.path.abspath(scene.render.filepath))
    if not animated and suffix.lower() in SUFFIXES.get(scene.render.file_extension, [scene.render.file_extension]):
        # Blender gives a still that has been named in full no number
        return stem
    path = bpy.path.abspath(scene.render.frame_path(frame=scene.frame_current))
    stem = os.path.splitext(path)[0]
    return f"{stem}-{scene.frame_current:04}" if scene.render.is_movie_format else stem


def _headless(yes):
    """Whether sessions of Cycles that are made from now on keep batches to themselves until they are
    complete."""
    import _cycles
    import cycles

    user = os.path.dirname(os.path.abspath(bpy.utils.user_resource("CONFIG", path="")))
    _cycles.init(os.path.dirname(cycles.__file__), user, yes)


# Blender copies the render settings between these two handlers. The copy, not the scene, has to say that
# Cycles keeps its scene from one call to the next.
@persistent
def before_copy(scene, *_):
    state.rendering, state.written = True, False
    state.begun, state.frames = time.monotonic(), 0
    if scene.noisefloor.use and scene.render.engine == "CYCLES":
        state.borrowed = scene.render.use_persistent_data
        scene.render.use_persistent_data = True
        state.shown = display.table(scene)


@persistent
def after_copy(scene, *_):
    state.frames += state.rendering
    ours = scene.noisefloor.use and scene.render.engine == "CYCLES" and not scene.render.use_multiview
    state.registering = (threading.get_ident(), scene.name) if ours and state.rendering else None
    if state.borrowed is not None:
        scene.render.use_persistent_data, state.borrowed = state.borrowed, None


@persistent
def written(scene, *_):
    state.written = True


@persistent
def completed(scene, *_):
    state.ended = "completed"
    if not state.wanted:
        state.took[scene.name] = (time.monotonic() - state.begun) / max(state.frames, 1)
    ended(scene)


@persistent
def cancelled(scene, *_):
    state.ended = "cancelled"
    ended(scene)


def ended(scene):
    state.rendering, state.status = False, None
    after_copy(scene)
    if scene.noisefloor.use and scene.render.engine == "CYCLES":
        # Setting it, to whatever, frees what the engine has kept if it is off
        scene.render.use_persistent_data = scene.render.use_persistent_data
        state.still = None if state.written or not scene.noisefloor.write_maps else scene.name
    if bpy.app.background:
        deliver()


def deliver():
    """Shows the maps as images, and writes a still that Blender has not written; in the thread with the
    windows."""
    with state.lock:
        images, state.images = state.images, {}
        still, state.still = bpy.data.scenes.get(state.still or ""), None
    if still and not still.render.is_movie_format:
        path = output(still, False) + still.render.file_extension
        try:
            bpy.data.images["Render Result"].save_render(path, scene=still)
        except RuntimeError as error:
            print(f"noisefloor: {path} cannot be written: {error}", flush=True)
    for name, picture in images.items():
        height, width = picture.shape[:2]
        image = bpy.data.images.get(name)
        if image is None or tuple(image.size) != (width, height):
            if image is not None:
                bpy.data.images.remove(image)
            image = bpy.data.images.new(name, width, height)
        pixels = numpy.ones((height, width, 4), numpy.float32)
        pixels[..., :3] = picture[::-1] / numpy.float32(255)
        image.pixels.foreach_set(pixels.ravel())
        image.update()


def tick():
    """Tells people how far it is."""
    if (state.images or state.still) and not state.rendering:
        deliver()
    if not state.rendering:
        state.texture = None
    text = state.status if state.rendering else None
    if text != tick.shown:
        for window in bpy.context.window_manager.windows:
            window.workspace.status_text_set(text)
        tick.shown = text
    return 0.5


tick.shown = None
METHODS = {
    "update": update,
    "update_render_passes": update_render_passes,
    "render": render,
    "draw": draw,
}
HANDLERS = [
    ("render_init", before_copy),
    ("render_pre", after_copy),
    ("render_write", written),
    ("render_complete", completed),
    ("render_cancel", cancelled),
]


def register():
    import cycles

    engine = cycles.CyclesRender
    original.update({name: getattr(engine, name) for name in METHODS}, free=cycles.engine.free)
    for name, method in METHODS.items():
        setattr(engine, name, method)
    for event, handler in HANDLERS:
        getattr(bpy.app.handlers, event).append(handler)
    if not bpy.app.background:
        bpy.app.timers.register(tick, first_interval=1, persistent=True)


def unregister():
    import cycles

    engine = cycles.CyclesRender
    for name in METHODS:
        setattr(engine, name, original[name])
    for event, handler in HANDLERS:
        getattr(bpy.app.handlers, event).remove(handler)
    if not bpy.app.background and bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
