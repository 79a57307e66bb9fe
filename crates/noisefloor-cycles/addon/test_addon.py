#!/usr/bin/env python3
"""Tests of the packed add-on in Blender as a module: test_addon.py ADDON.zip [TEST...]

Run it by a Python that has bpy (4.2 or later) and the wheel of noisefloor: the private environment of
`noisefloor doctor --install cycles` after `pip install`, for example. Or in Blender: blender -b
--factory-startup --python test_addon.py -- ADDON.zip
"""

import os
import pathlib
import runpy
import subprocess
import sys
import tempfile
import unittest
import zipfile

import bpy
import numpy

ADDON = pathlib.Path(__file__).resolve().parent
WORK = tempfile.TemporaryDirectory(prefix="noisefloor-addon-")
FOLDER = pathlib.Path(WORK.name)
SIZE = (128, 96)

# What the host of the command renders: the first six batches of the frame, and the fourth of a part of it
HOST = """
import runpy, sys
import numpy
script, scene, out = sys.argv[1:]
host = runpy.run_path(script, run_name="tested")["Cycles"]({"scene": scene, "seed": 5})
frame = {"index": 0, "x": 0, "y": 0, "width": 128, "height": 96, "samples": 16}
part = {"index": 1, "x": 64, "y": 32, "width": 40, "height": 64, "sequence": 1, "point": 16, "samples": 16}
batches = [host.sample([{**frame, "sequence": k % 2, "point": k // 2 * 16}])[0][1] for k in range(6)]
numpy.savez(out, part=host.sample([part])[0][1], batches=numpy.array(batches))
"""


def room(closed=False):
    """A cube on a plane, which costs little; closed, in a box, in which tiles with its shadow have more
    noise than others."""
    bpy.ops.wm.read_factory_settings()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles, render = scene.cycles, scene.render
    cycles.device, cycles.seed, cycles.samples, cycles.use_denoising = "CPU", 5, 8, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    bpy.data.lights["Light"].shadow_soft_size = 3
    if closed:
        bpy.ops.mesh.primitive_cube_add(size=20, location=(0, 0, 9))
    else:
        bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    render.filepath = str(FOLDER / f"picture{len(list(FOLDER.iterdir()))}-")
    settings = render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = (
        "OPEN_EXR",
        "RGBA",
        "32",
        "NONE",
    )
    scene.noisefloor.use, scene.noisefloor.tile = True, 64
    scene.noisefloor.min_samples, scene.noisefloor.max_samples = 96, 160
    return scene


def pixels(path):
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    flat = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(flat)
    width, height = image.size
    bpy.data.images.remove(image)
    return flat.reshape(height, width, -1)[::-1]


# Sequence and first point of a frame's batches, in order
POINTS = [(k % 2, k // 2 * 16) for k in range(6)]


def rendered(scene):
    """The picture, and the pictures of all batches with their regions and points, in the order in which Cycles
    rendered them."""
    batches, sample = [], frame.Frame._sample

    def record(self, region, points):
        pictures = sample(self, region, points)
        batches.append((region, points, pictures["Combined"].copy()))
        return pictures

    frame.Frame._sample = record
    try:
        bpy.ops.render.render(write_still=True)
    finally:
        frame.Frame._sample = sample
    return pixels(scene.render.filepath + ".exr"), batches


def facts(scene):
    """All that is set of a scene's rendering."""
    found = {}
    layers = [("layer", layer) for layer in scene.view_layers] + [
        ("layer cycles", layer.cycles) for layer in scene.view_layers
    ]
    groups = [
        ("render", scene.render),
        ("image", scene.render.image_settings),
        ("cycles", scene.cycles),
        ("noisefloor", scene.noisefloor),
        ("view", scene.view_settings),
        ("scene", scene),
        *layers,
    ]
    for name, group in groups:
        for prop in group.bl_rna.properties:
            if prop.type not in ("POINTER", "COLLECTION"):
                value = getattr(group, prop.identifier)
                found[name, prop.identifier] = (
                    value if isinstance(value, (str, int, float, set)) else tuple(value)
                )
    # Names change when a scene is loaded beside another
    return {
        key: value
        for key, value in found.items()
        if key[1] not in ("name", "name_full", "session_uid", "is_evaluated")
    }


def assert_same(one, other, samples, what=""):
    """The same samples: Cycles' threads add them in any order, in float32, and light is not negative."""
    numpy.testing.assert_allclose(one, other, rtol=2 * samples * 2**-24, err_msg=what)


class Addon(unittest.TestCase):
    def test_off_it_changes_nothing(self):
        scene = room()
        scene.noisefloor.use = False
        with_it, batches = rendered(scene)
        noisefloor_addon.unregister()
        try:
            without = rendered(scene)[0]
        finally:
            noisefloor_addon.register()
        self.assertEqual(batches, [])
        assert_same(with_it, without, scene.cycles.samples)

    def test_no_setting_changes_nor_is_saved_while_it_renders(self):
        scene, seen = room(), []
        before, saved, sample = facts(scene), FOLDER / "saved.blend", frame.Frame._sample

        def look(self, region, points):
            pictures = sample(self, region, points)
            seen.append(facts(scene))
            if points == POINTS[2]:
                bpy.data.libraries.write(str(saved), {scene})
            return pictures

        frame.Frame._sample = look
        try:
            bpy.ops.render.render()
        finally:
            frame.Frame._sample = sample
        self.assertGreater(len(seen), 5)
        for facts_then in [*seen, facts(scene)]:
            self.assertEqual(facts_then, before)
        with bpy.data.libraries.load(str(saved)) as (there, here):
            here.scenes = there.scenes
        self.assertEqual(facts(here.scenes[0]), before)

    def test_after_an_error_all_is_as_before(self):
        scene, sample = room(), frame.Frame._sample
        before = facts(scene)

        def fail(self, region, points):
            if points == POINTS[2]:
                raise ValueError("on purpose")
            return sample(self, region, points)

        frame.Frame._sample = fail
        try:
            with self.assertRaisesRegex(RuntimeError, "on purpose"):
                bpy.ops.render.render()
        finally:
            frame.Frame._sample = sample
        self.assertEqual(facts(scene), before)
        self.assertGreater(len(rendered(scene)[1]), 5)

    @unittest.skipIf(bpy.app.binary_path, "the host of the command needs Blender as a module")
    def test_samples_are_those_of_the_command(self):
        scene = room()
        blend = FOLDER / "room.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
        batches = rendered(scene)[1]
        script, out = FOLDER / "host" / "cycles_host.py", FOLDER / "host.npz"
        script.parent.mkdir(exist_ok=True)
        host = (ADDON.parent / "host" / "cycles_host.py").read_text()
        script.write_text((FOLDER / "noisefloor_addon" / "sampling.py").read_text() + "\n\n" + host)
        (script.parent / "host.py").write_text((FOLDER / "noisefloor_addon" / "host.py").read_text())
        (FOLDER / "run.py").write_text(HOST)
        subprocess.run([sys.executable, FOLDER / "run.py", script, blend, out], check=True)
        with numpy.load(out) as theirs:
            for k, (region, points, picture) in enumerate(batches[:6]):
                self.assertEqual((region, points), ((0, 0, *SIZE), POINTS[k]))
                assert_same(picture[..., :3], theirs["batches"][k], 16, f"batch {k}")
            assert_same(batches[3][2][32:96, 64:104, :3], theirs["part"], 16)
        self.assertGreater(numpy.abs(batches[0][2] - batches[1][2]).max(), 0.01)

    def test_the_picture_is_the_mean_of_its_batches(self):
        scene = room(closed=True)
        # More people see where there is more noise
        scene.noisefloor.max_samples, scene.noisefloor.people = 2048, 0.99
        picture, batches = rendered(scene)
        total, count = numpy.zeros((*SIZE[::-1], 4)), numpy.zeros((*SIZE[::-1], 1))
        for (x, y, width, height), _, batch in batches:
            total[y : y + height, x : x + width] += batch
            count[y : y + height, x : x + width] += 1
        # A film in float32 rounds each of at most 128 batches
        numpy.testing.assert_allclose(picture, total / count, rtol=128 * 2**-24, atol=1e-6)
        self.assertGreater(count.max(), count.min(), "all tiles stopped alike: a scene that tests nothing")
        summary = hooks.state.summary
        self.assertIn("4 of 4 tiles without visible noise", summary)
        self.assertIn(f"{16 * int(count.min())} to {16 * int(count.max())} samples", summary)

    def test_passes_maps_summary_and_metadata_are_left(self):
        scene = room()
        layer, settings = scene.view_layers[0], scene.render.image_settings
        layer.use_pass_z = layer.use_pass_normal = layer.use_pass_cryptomatte_object = True
        picture, _ = rendered(scene)
        exr = pathlib.Path(scene.render.filepath + ".exr").read_bytes()
        self.assertIn(b"tiles without visible noise", exr)
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        bpy.data.images["Render Result"].save_render(str(FOLDER / "layers.exr"))
        layers = (FOLDER / "layers.exr").read_bytes()
        for name in [
            "Combined",
            "Depth",
            "Normal",
            "CryptoObject00",
            "noisefloor Samples",
            "noisefloor Visible Noise",
        ]:
            self.assertIn(f".{name}.".encode(), layers)
        stem = f"{scene.render.filepath}{scene.frame_current:04}"
        self.assertEqual(pathlib.Path(stem + "-noisefloor.txt").read_text().strip(), hooks.state.summary)
        for name in ["samples", "visible-noise"]:
            shown = bpy.data.images["noisefloor " + name.replace("-", " ")]
            self.assertEqual(tuple(shown.size), SIZE)
            self.assertEqual(pixels(f"{stem}-{name}.png").shape[:2], SIZE[::-1])
        # Depth is a label: that of the plane and the cube, not a mean over batches with the far background
        self.assertGreater(picture[..., :3].std(), 0.01)

    def test_limits_and_esc_keep_what_there_is(self):
        scene = room()
        scene.noisefloor.max_samples, scene.noisefloor.people = 64, 0.99
        _, batches = rendered(scene)
        self.assertEqual([points for _, points, _ in batches], POINTS[:4])
        scene.noisefloor.time_limit = 1e-3
        picture, batches = rendered(scene)
        numpy.testing.assert_allclose(picture, batches[0][2], rtol=1e-6)
        self.assertIn("4 ended: time-limit", hooks.state.summary)
        scene.noisefloor.time_limit, calls = 0, []

        def esc(self):
            calls.append(None)
            return len(calls) > 2

        cancelled, frame.Frame._cancelled = frame.Frame._cancelled, esc
        try:
            picture, batches = rendered(scene)
        finally:
            frame.Frame._cancelled = cancelled
        self.assertEqual(len(batches), 3)
        numpy.testing.assert_allclose(picture, (batches[0][2] + batches[1][2]) / 2, rtol=1e-6)
        self.assertIn("4 ended: cancelled", hooks.state.summary)

    def test_animations_resume_frame_by_frame(self):
        scene = room()
        scene.frame_start, scene.frame_end, scene.noisefloor.max_samples = 1, 3, 96
        scene.cycles.use_animated_seed, scene.render.use_overwrite = True, False
        there = pathlib.Path(scene.render.frame_path(frame=2))
        there.write_bytes(b"rendered before")
        bpy.ops.render.render(animation=True)
        self.assertEqual(there.read_bytes(), b"rendered before")
        first, third = (pixels(scene.render.frame_path(frame=frame)) for frame in (1, 3))
        self.assertGreater(numpy.abs(first - third).max(), 0.01)
        self.assertTrue(pathlib.Path(scene.render.filepath + "0003-samples.png").exists())
        self.assertFalse(pathlib.Path(scene.render.filepath + "0002-samples.png").exists())

    def test_animations_are_judged_as_films_and_stills_as_stills(self):
        scene, judged, made = room(), [], settings.params

        def record(*arguments):
            params = made(*arguments)
            judged.append(params.viewing.frames_per_second)
            return params

        scene.frame_start, scene.frame_end, scene.noisefloor.max_samples = 1, 2, 96
        scene.render.fps, scene.render.fps_base = 24, 1.001
        settings.params = record
        try:
            for animated in (True, False):
                scene.cycles.use_animated_seed = animated
                bpy.ops.render.render(animation=True)
                self.assertEqual("23.976 frames a second" in hooks.state.summary, animated, hooks.state.summary)
            scene.cycles.use_animated_seed = True
            bpy.ops.render.render(animation=True)
            both = [pixels(scene.render.frame_path(frame=frame_number)) for frame_number in (1, 2)]
            scene.frame_set(2)
            alone = rendered(scene)[0]
        finally:
            settings.params = made
        # Each frame has a seed of its own, whatever was rendered before it
        assert_same(both[1], alone, 96)
        self.assertGreater(numpy.abs(both[0] - both[1]).max(), 0.01)
        self.assertEqual(judged, [23.976, 23.976, None, None, 23.976, 23.976, None])

    def test_a_region_is_a_part_of_the_frame(self):
        scene = room()
        scene.noisefloor.max_samples = 96
        whole = rendered(scene)[0]
        render = scene.render
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = (
            0.3,
            0.85,
            0.2,
            0.7,
        )
        part = rendered(scene)[0]
        left, bottom = int(0.3 * SIZE[0]), int(0.2 * SIZE[1])
        top = SIZE[1] - bottom - part.shape[0]
        assert_same(part, whole[top : top + part.shape[0], left : left + part.shape[1]], 96)

    def test_what_moves_is_blurred_as_by_cycles(self):
        scene = room()
        scene.noisefloor.max_samples, scene.render.use_motion_blur, cube = 96, True, bpy.data.objects["Cube"]
        for frame_number in (1, 3):
            cube.location.x = frame_number - 2
            cube.keyframe_insert("location", frame=frame_number)
            scene.cycles.samples = frame_number
            scene.cycles.keyframe_insert("samples", frame=frame_number)
        scene.frame_set(2)
        picture, batches = rendered(scene)
        self.assertGreater(numpy.abs(batches[0][2] - batches[1][2]).mean(), 0)
        scene.animation_data_clear()
        scene.noisefloor.use, scene.cycles.samples, scene.cycles.use_adaptive_sampling = False, 96, False
        plain, still = rendered(scene)[0], numpy.abs(batches[0][2] - picture).mean()
        # Both have at most a sixth of the variance of a batch: they differ by √(2/6) of what a batch does, or less
        self.assertLess(numpy.abs(picture - plain).mean(), still)

    def test_every_layer_has_its_own_stops(self):
        scene = room()
        scene.noisefloor.max_samples = 96
        scene.view_layers.new("second").use_sky = False
        _, batches = rendered(scene)
        self.assertEqual([points for _, points, _ in batches], POINTS * 2)
        self.assertIn("noisefloor samples, second", bpy.data.images)

    def test_denoised_pictures_have_less_noise(self):
        scene = room()
        scene.noisefloor.max_samples = 96
        noisy, _ = rendered(scene)
        scene.cycles.use_denoising = True
        if denoise.library() is None:
            self.skipTest("this Blender has no Open Image Denoise")
        picture, batches = rendered(scene)
        mean = sum(batch for _, _, batch in batches) / len(batches)
        numpy.testing.assert_allclose(mean, noisy, rtol=1e-5, atol=1e-6)

        def roughness(image):
            return numpy.abs(numpy.diff(image[..., 1], axis=1)).mean()

        self.assertLess(roughness(picture), 0.8 * roughness(noisy))
        self.assertLess(abs(picture[..., :3].mean() / noisy[..., :3].mean() - 1), 0.02)


    def test_the_table_shows_what_blender_shows(self):
        scene, random = room(), numpy.random.default_rng(3)
        view, settings = scene.view_settings, scene.render.image_settings
        before = facts(scene)
        # Levels over 20 stops, and colours around them: 256x256 pixels
        level, colour = random.uniform(-14, 6, (65536, 1)), random.uniform(-1.2, 1.2, (65536, 3))
        radiance = numpy.ones((65536, 4), numpy.float32)
        radiance[:, :3] = numpy.exp2(level + colour)
        image = bpy.data.images.new("radiance", 256, 256, float_buffer=True)
        image.pixels.foreach_set(radiance.ravel())
        for transform, exposure, gamma in [("Standard", 0, 1), ("Filmic", 2, 1), (view.view_transform, -3, 1.2)]:
            view.view_transform, view.exposure, view.gamma = transform, exposure, gamma
            table, toe, top = display.table(scene).__getnewargs__()
            kept = settings.file_format, settings.color_depth
            settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
            image.save_render(str(FOLDER / "shown.png"), scene=scene)
            settings.file_format, settings.color_depth = kept
            shown = pixels(FOLDER / "shown.png")[::-1].reshape(-1, 4)[:, :3]
            # Where the manual of the table says that a radiance lies; this interpolates on its own
            floor = numpy.floor(numpy.log2(1 + radiance[:, :3] / toe))
            stops = floor + (1 + radiance[:, :3] / toe) / 2**floor - 1
            last = len(table) - 1
            whole = numpy.floor(numpy.log2(1 + top / toe))
            place = numpy.minimum(stops / (whole + (1 + top / toe) / 2**whole - 1) * last, last)
            low = numpy.minimum(place.astype(int), last - 1)
            share, found = place - low, 0
            for corner in numpy.ndindex(2, 2, 2):
                weight = numpy.where(corner, share, 1 - share).prod(axis=1, keepdims=True)
                red, green, blue = (low + corner).T
                found = found + weight * table[blue, green, red]
            off = numpy.abs(found - shown) * 255
            self.assertLessEqual(numpy.median(off), 1, transform)
            self.assertLessEqual(numpy.quantile(off, 0.999), 3, transform)
        view.view_transform, view.exposure, view.gamma = (
            before["view", name] for name in ("view_transform", "exposure", "gamma")
        )
        settings.color_mode = before["image", "color_mode"]
        self.assertEqual(facts(scene), before)

    def test_the_picture_is_judged_as_it_is_shown(self):
        scene, samples = room(closed=True), []
        scene.noisefloor.max_samples, scene.noisefloor.people = 4096, 0.99
        scene.noisefloor.min_samples = 32
        for exposure in (-6, 0):
            scene.view_settings.exposure = exposure
            rendered(scene)
            samples.append(float(hooks.state.summary.split(" samples per pixel, ")[1].split(" on average")[0]))
        # Noise that is shown as black is not seen
        self.assertLess(samples[0], 0.7 * samples[1])

    def test_a_threshold_is_found_and_nothing_else_changes(self):
        for denoised in (False, True):
            with self.subTest(denoised=denoised):
                scene = room(closed=True)
                scene.cycles.use_denoising, scene.cycles.samples = denoised, 4096
                if denoised and denoise.library() is None:
                    self.skipTest("this Blender has no Open Image Denoise")
                before = facts(scene)
                self.assertEqual(bpy.ops.render.noisefloor_threshold(), {"FINISHED"})
                found, after = scene.cycles.adaptive_threshold, facts(scene)
                changed = {key for key in before if before[key] != after[key]}
                self.assertLessEqual(
                    changed, {("cycles", "adaptive_threshold"), ("cycles", "use_adaptive_sampling")}
                )
                self.assertTrue(0.001 <= found < 0.2001, found)
                self.assertIn(f"{found:.3g}", hooks.state.summary)
                if denoised:
                    continue
                # Other seeds, through the panel's own way: what was found passes, and thrice as much does not
                ratios = []
                for threshold in (found, 3 * found):
                    pair = []
                    for seed in (101, 202):
                        cycles = scene.cycles
                        cycles.adaptive_threshold, cycles.seed = threshold * 2**0.5, seed
                        scene.noisefloor.use = False
                        pair.append(rendered(scene)[0][..., :3])
                    params = settings.still_params(scene, display.table(scene))
                    ratios.append(noisefloor.excess(*pair, params=params).ratio)
                self.assertLess(ratios[0], 1.2)
                self.assertGreater(ratios[1], 1.2)

    def test_a_search_that_finds_nothing_says_why(self):
        scene = room(closed=True)
        # So few samples that no threshold is reached
        scene.cycles.samples = 8
        before = facts(scene)
        with self.assertRaisesRegex(RuntimeError, "Max Samples"):
            bpy.ops.render.noisefloor_threshold()
        self.assertEqual(facts(scene), before)


arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
zipfile.ZipFile(arguments[0]).extractall(FOLDER)
sys.path.insert(0, str(FOLDER))
import noisefloor_addon
import noisefloor
from noisefloor_addon import denoise, display, frame, hooks, settings

noisefloor_addon.register()
result = unittest.main(argv=["test_addon.py", *arguments[1:]], exit=False).result
noisefloor_addon.unregister()
WORK.cleanup()
sys.stdout.flush()
# Blender as a module may crash while Python ends
os._exit(0 if result.wasSuccessful() else 1)
