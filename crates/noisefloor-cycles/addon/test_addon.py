#!/usr/bin/env python3
"""Tests of the packed add-on in Blender as a module: test_addon.py ADDON.zip [TEST...]

Run it by a Python that has bpy (4.2 or later) and the wheel of noisefloor: the private environment of
`noisefloor doctor --install cycles` after `pip install`, for example. Or in Blender: blender -b
--factory-startup --python test_addon.py -- ADDON.zip
"""

import contextlib
import itertools
import os
import pathlib
import sys
import tempfile
import types
import unittest
import zipfile
from unittest.mock import MagicMock, patch

import bpy
import numpy

WORK = tempfile.TemporaryDirectory(prefix="noisefloor-addon-")
FOLDER = pathlib.Path(WORK.name)
SIZE = (128, 96)

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
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGBA", "32", "NONE"
    scene.noisefloor.use, scene.noisefloor.max_samples = True, 160
    return scene


def pixels(path):
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    flat = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(flat)
    width, height = image.size
    bpy.data.images.remove(image)
    return flat.reshape(height, width, -1)[::-1]


def rendered(scene):
    """The picture, and all pictures that Cycles rendered for it, in order, with their regions, halves, thresholds and
    the samples of their pixels."""
    parts, sample = [], frame.Frame._sample

    def record(self, region, half, threshold, samples, seconds):
        pictures, counts = sample(self, region, half, threshold, samples, seconds)
        parts.append((region, half, threshold, pictures["Combined"].copy(), counts))
        return pictures, counts

    with patch.object(frame.Frame, "_sample", record):
        bpy.ops.render.render(write_still=True)
    return pixels(scene.render.filepath + ".exr"), parts


def passes_in_file(scene):
    """The bytes of a file of the last render with all passes, whose names begin and end with a dot."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    bpy.data.images["Render Result"].save_render(str(FOLDER / "layers.exr"))
    return (FOLDER / "layers.exr").read_bytes()


@contextlib.contextmanager
def before_each_render(record):
    """Calls a function with the scene before each picture that Blender renders."""
    handler = lambda scene, *_: record(scene)
    bpy.app.handlers.render_pre.append(handler)
    try:
        yield
    finally:
        bpy.app.handlers.render_pre.remove(handler)


def mean(parts):
    """The mean of all samples, and how many there are."""
    total, count = numpy.zeros((*SIZE[::-1], 4)), numpy.zeros((*SIZE[::-1], 1))
    for (x, y, width, height), _, _, picture, counts in parts:
        total[y : y + height, x : x + width] += picture * counts
        count[y : y + height, x : x + width] += counts
    return total / numpy.maximum(count, 1), count


def looked_up(table, radiance):
    """What a table shows, (n, 3): where its manual says that a radiance lies, interpolated without its code; and the least
    and the greatest of the entries around it."""
    table, toe, top = table.__getnewargs__()
    floor = numpy.floor(numpy.log2(1 + radiance / toe))
    stops = floor + (1 + radiance / toe) / 2**floor - 1
    last, whole = len(table) - 1, numpy.floor(numpy.log2(1 + top / toe))
    place = numpy.minimum(stops / (whole + (1 + top / toe) / 2**whole - 1) * last, last)
    low = numpy.minimum(place.astype(int), last - 1)
    share, found, entries = place - low, 0, []
    for corner in numpy.ndindex(2, 2, 2):
        red, green, blue = (low + corner).T
        entries.append(table[blue, green, red])
        found = found + numpy.where(corner, share, 1 - share).prod(axis=1, keepdims=True) * entries[-1]
    return found, numpy.min(entries, axis=0), numpy.max(entries, axis=0)


def facts(scene):
    """All that is set of a scene's rendering."""
    found, render = {}, scene.render
    groups = {"render": render, "image": render.image_settings, "cycles": scene.cycles, "view": scene.view_settings}
    groups |= {"noisefloor": scene.noisefloor, "scene": scene}
    for layer in scene.view_layers:
        groups |= {f"layer {layer.name}": layer, f"cycles of {layer.name}": layer.cycles}
    for name, group in groups.items():
        for prop in group.bl_rna.properties:
            # Names change when a scene is loaded beside another
            names = ("name", "name_full", "session_uid", "is_evaluated")
            if prop.type not in ("POINTER", "COLLECTION") and prop.identifier not in names:
                value = getattr(group, prop.identifier)
                found[name, prop.identifier] = value if isinstance(value, (str, int, float, set)) else tuple(value)
    return found


def assert_same(one, other, samples, what=""):
    """The same samples: Cycles' threads add them in any order, in float32, and light is not negative."""
    numpy.testing.assert_allclose(one, other, rtol=2 * samples * 2**-24, err_msg=what)


def passes_of(engine, layer):
    """All passes that a render has left, by name; rows from the bottom."""
    result, found = engine.get_result(), {}
    for each in result.layers[layer].passes:
        flat = numpy.empty(result.resolution_x * result.resolution_y * each.channels, numpy.float32)
        each.rect.foreach_get(flat)
        found[each.name] = flat.reshape(result.resolution_y, result.resolution_x, each.channels)
    return found


@contextlib.contextmanager
def recorded():
    """What Cycles renders meanwhile, picture by picture, and what the add-on makes of that, by layer."""
    seen = types.SimpleNamespace(cycles={}, made={}, settings=[])
    real, real_finish, real_adapt = hooks.original["render"], frame.Frame.finish, sampling.adapt

    def render(engine, depsgraph):
        layer = depsgraph.view_layer_eval.name
        real(engine, depsgraph)
        seen.cycles.setdefault(layer, []).append(passes_of(engine, layer))

    def finish(each):
        maps = real_finish(each)
        seen.made[each.layer] = passes_of(each.engine, each.layer)
        return maps

    def adapt(cycles, seed, threshold, samples):
        seen.settings.append((seed, threshold, samples))
        real_adapt(cycles, seed, threshold, samples)

    cycles, own = patch.dict(hooks.original, render=render), patch.object(frame.Frame, "finish", finish)
    with cycles, own, patch.object(sampling, "adapt", adapt):
        yield seen


def transparent(scene):
    scene.render.film_transparent = True


def shadows(scene):
    transparent(scene)
    bpy.data.objects["Plane"].is_shadow_catcher = True


def apart(scene, name):
    """Puts the cube into a collection of its own, which the layer has like this."""
    cube, own = bpy.data.objects["Cube"], bpy.data.collections.new("own")
    for collection in cube.users_collection:
        collection.objects.unlink(cube)
    scene.collection.children.link(own)
    own.objects.link(cube)
    setattr(scene.view_layers[0].layer_collection.children["own"], name, True)


def glass(scene):
    transparent(scene)
    scene.cycles.film_transparent_glass = True
    bpy.data.objects["Cube"].data.materials[0] = scenes.material(Transmission_Weight=1.0, Roughness=0.0)


def groups(scene):
    layer = scene.view_layers[0]
    bpy.ops.scene.view_layer_add_lightgroup(name="key")
    bpy.data.objects["Light"].lightgroup = "key"
    assert [group.name for group in layer.lightgroups] == ["key"]


def excess_of(squares):
    """What a judge has found, of squares with x, y, width, height and ratio."""
    ratio, left = max(ratio for *_, ratio in squares), numpy.zeros(SIZE[::-1], numpy.float32)
    return types.SimpleNamespace(squares=lambda: squares, ratio=ratio, map=lambda: left)


def everything(scene):
    """All passes that there are."""
    layer = scene.view_layers[0]
    for group in (layer, layer.cycles):
        for prop in group.bl_rna.properties:
            if prop.identifier.startswith("use_pass_") and prop.identifier != "use_pass_shadow_catcher":
                setattr(group, prop.identifier, True)
    aov = layer.aovs.add()
    aov.name, aov.type = "Depth of mine", "VALUE"
    cube = bpy.data.objects["Cube"]
    cube.pass_index = 7
    tree = cube.data.materials[0].node_tree
    node, where = tree.nodes.new("ShaderNodeOutputAOV"), tree.nodes.new("ShaderNodeNewGeometry")
    node.aov_name = "Depth of mine"
    tree.links.new(where.outputs["Position"], node.inputs["Value"])


def moving(scene):
    """Blurred by motion. The keys say 2 samples, and hold again whenever Cycles moves the scene."""
    scene.render.use_motion_blur, cube = True, bpy.data.objects["Cube"]
    for frame_number in (1, 3):
        cube.location.x, scene.cycles.samples = frame_number - 2, frame_number
        cube.keyframe_insert("location", frame=frame_number)
        scene.cycles.keyframe_insert("samples", frame=frame_number)
    scene.frame_set(2)


def region(scene, crop):
    render = scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.3, 0.85, 0.2, 0.75


# Switches of Film, Visibility, View Layer and Output, by name
SWITCHES = {
    "none": lambda scene: None,
    "transparent": transparent,
    "glass": glass,
    "exposure": lambda scene: setattr(scene.cycles, "film_exposure", 2.5),
    "filter": lambda scene: setattr(scene.cycles, "pixel_filter_type", "BLACKMAN_HARRIS"),
    "catcher": shadows,
    "catcher with a sky": lambda scene: setattr(bpy.data.objects["Plane"], "is_shadow_catcher", True),
    "catcher as a pass": lambda scene: (
        shadows(scene),
        setattr(scene.view_layers[0].cycles, "use_pass_shadow_catcher", True),
    ),
    "holdout": lambda scene: (transparent(scene), setattr(bpy.data.objects["Cube"], "is_holdout", True)),
    "held out collection": lambda scene: (transparent(scene), apart(scene, "holdout")),
    "indirect only": lambda scene: apart(scene, "indirect_only"),
    "unseen": lambda scene: setattr(bpy.data.objects["Cube"], "visible_camera", False),
    "no sky": lambda scene: setattr(scene.view_layers[0], "use_sky", False),
    "material override": lambda scene: setattr(
        scene.view_layers[0], "material_override", bpy.data.materials["Material"]
    ),
    "not denoised layer": lambda scene: setattr(scene.view_layers[0].cycles, "use_denoising", False),
    "samples of the layer": lambda scene: setattr(scene.view_layers[0], "samples", 3),
    "light groups": groups,
    "all passes": everything,
    "two layers": lambda scene: setattr(scene.view_layers.new("second"), "use_sky", False),
    "border": lambda scene: region(scene, False),
    "crop": lambda scene: region(scene, True),
    "motion blur": moving,
}


class Addon(unittest.TestCase):
    def search(self, scene):
        """Finds a threshold, and nothing else changes; all that is set afterwards."""
        before = facts(scene)
        self.assertEqual(bpy.ops.render.noisefloor_threshold(), {"FINISHED"})
        after, found = facts(scene), scene.cycles.adaptive_threshold
        self.assertTrue(0.001 <= found < 0.2001, found)
        self.assertIn(f"{found:.3g}", hooks.state.summary)
        changed = {key for key in before if before[key] != after[key]}
        self.assertLessEqual(changed, {("cycles", "adaptive_threshold"), ("cycles", "use_adaptive_sampling")})
        return after

    def needs_denoiser(self):
        if denoise.library() is None:
            self.skipTest("this Blender has no Open Image Denoise")

    def test_every_switch_does_what_it_does_without_the_loop(self):
        """By colour and alpha, in all passes: the mean of two pictures that Cycles renders by itself, with their seeds."""
        for name, switch in SWITCHES.items():
            with self.subTest(switch=name):
                scene = room()
                scene.render.resolution_x, scene.render.resolution_y = 96, 72
                scene.noisefloor.max_samples = 64
                switch(scene)
                found, files = {}, {}
                for denoised in (False, True):
                    scene.cycles.use_denoising = denoised
                    with recorded() as loop:
                        bpy.ops.render.render(write_still=True)
                    found[denoised], files[denoised] = loop.made, pixels(scene.render.filepath + ".exr")
                layers = [layer.name for layer in scene.view_layers]
                self.assertEqual(sorted(found[False]), sorted(layers))
                for layer in layers if len(layers) > 1 else []:
                    self.assertIn(f"noisefloor samples, {layer}", bpy.data.images)
                # The same pictures by Cycles itself, whose noise was nowhere below its threshold
                scene.animation_data_clear()
                scene.noisefloor.use, scene.cycles.use_denoising = False, False
                cycles = scene.cycles
                cycles.use_adaptive_sampling, scene.cycles.use_layer_samples = True, "IGNORE"
                with recorded() as plain:
                    for cycles.seed, cycles.adaptive_threshold, cycles.samples in loop.settings[:2]:
                        bpy.ops.render.render(write_still=True)
                cycles.use_denoising, cycles.samples = True, 64
                with recorded() as own:
                    bpy.ops.render.render(write_still=True)
                file = pixels(scene.render.filepath + ".exr")
                for layer in layers:
                    self.compare(layer, {key: value[layer] for key, value in found.items()}, plain.cycles[layer])
                    self.assert_denoised(found[True][layer], own.cycles[layer][0])
                for denoised, written in files.items():
                    self.assertEqual(written.shape, file.shape)
                    self.assertLess(numpy.abs(written - file).mean(), 0.03 * file.max(), (name, denoised))
                    if name == "border":
                        outside = (file == 0).all(axis=-1)
                        self.assertGreater(outside.mean(), 0.5)
                        self.assertTrue((written[outside] == 0).all())

    def compare(self, layer, found, plain):
        """What the loop has found of a layer, not denoised and denoised, with two pictures of Cycles."""
        noisy = found[True].get("Noisy Image")
        if layer == "ViewLayer" and noisy is None:
            self.assertFalse(bpy.context.scene.view_layers[layer].cycles.use_denoising)
            noisy = found[True]["Combined"]
        for name, first in plain[0].items():
            both = [first, plain[1][name]]
            wanted = first if passes.LABELS.match(name) else sum(both) / 2
            every = [found[False][name], noisy if name == "Combined" else found[True][name]]
            if name == "Shadow Catcher":
                every[1] = found[True]["Noisy Shadow Catcher"]
            if name == "Debug Sample Count":
                continue
            for made in every:
                # Cycles' threads add samples in any order, in float32; near 0, alpha and ratios are differences
                numpy.testing.assert_allclose(made, wanted, rtol=1e-4, atol=1e-5, err_msg=f"{layer}: {name}")

    def assert_denoised(self, made, own):
        """Denoised as by Cycles, of which the samples are others."""
        self.assertEqual(set(own) - set(made), set())
        for name in ("Combined", "Shadow Catcher"):
            if name in own:
                off = numpy.abs(made[name] - own[name]).mean(axis=(0, 1))
                self.assertTrue((off < 0.02 * max(own[name].max(), 1)).all(), (name, off))

    def test_stereo_is_left_to_cycles(self):
        scene = room()
        scene.render.use_multiview = scene.cycles.use_denoising = True
        with recorded() as both:
            bpy.ops.render.render()
        self.assertEqual(both.made, {})
        self.assertIn("Noisy Image", both.cycles["ViewLayer"][0])

    def test_noise_of_alpha_is_seen(self):
        """Of a catcher's shadow, there is nothing but alpha: what lies behind shines through, here as bright as middle grey."""
        scene, random = room(), numpy.random.default_rng(1)
        scene.render.film_transparent, shown = True, display.table(scene)

        def shadow():
            picture = numpy.zeros((*SIZE[::-1], 4), numpy.float32)
            picture[..., 3] = random.normal(0.5, 0.15, SIZE[::-1])
            return picture

        pair = shadow(), shadow()
        judge = judging.Judge(scene, shown, None, False, True)
        found = judge.excess([{"Combined": picture} for picture in pair]).ratio
        grey = [numpy.repeat(0.18 * (1 - picture[..., 3:]), 3, axis=2).astype(numpy.float32) for picture in pair]
        self.assertAlmostEqual(found, noisefloor.excess(*grey, params=settings.params(scene, shown)).ratio, places=4)
        self.assertGreater(found, 1)

    def test_maps_are_named_like_the_still(self):
        scene = room()
        scene.noisefloor.max_samples = 64
        settings = scene.render.image_settings
        settings.file_format = "PNG"
        for name, stem in [("shot.png", "shot"), ("shot.v2", "shot.v20001"), ("other.PNG", "other")]:
            scene.render.filepath = str(FOLDER / name)
            bpy.ops.render.render(write_still=True)
            self.assertTrue((FOLDER / f"{stem}-samples.png").exists(), sorted(FOLDER.iterdir()))
        self.assertTrue((FOLDER / "shot.png").exists())

    def test_off_it_changes_nothing(self):
        scene = room()
        scene.noisefloor.use = False
        with_it, parts = rendered(scene)
        noisefloor_addon.unregister()
        try:
            without = rendered(scene)[0]
        finally:
            noisefloor_addon.register()
        self.assertEqual(parts, [])
        assert_same(with_it, without, scene.cycles.samples)

    def test_no_setting_changes_nor_is_saved_while_it_renders(self):
        scene, seen = room(), []
        before, saved, sample = facts(scene), FOLDER / "saved.blend", frame.Frame._sample

        def look(self, *arguments):
            pictures = sample(self, *arguments)
            seen.append(facts(scene))
            if len(seen) == 2:
                bpy.data.libraries.write(str(saved), {scene})
            return pictures

        with patch.object(frame.Frame, "_sample", look):
            bpy.ops.render.render()
        self.assertGreater(len(seen), 1)
        for facts_then in [*seen, facts(scene)]:
            self.assertEqual(facts_then, before)
        with bpy.data.libraries.load(str(saved)) as (there, here):
            here.scenes = there.scenes
        self.assertEqual(facts(here.scenes[0]), before)

    def test_after_an_error_all_is_as_before(self):
        scene, sample = room(), frame.Frame._sample
        before = facts(scene)

        def fail(self, region, half, *more):
            if half == 1:
                raise ValueError("on purpose")
            return sample(self, region, half, *more)

        with patch.object(frame.Frame, "_sample", fail), self.assertRaisesRegex(RuntimeError, "on purpose"):
            bpy.ops.render.render()
        self.assertEqual(facts(scene), before)
        self.assertGreater(len(rendered(scene)[1]), 1)

    def test_the_picture_is_the_mean_of_all_samples(self):
        scene = room(closed=True)
        scene.noisefloor.max_samples, scene.noisefloor.people, scene.cycles.adaptive_min_samples = 4096, 0.9, 40
        told, progress = [], frame.Frame.progress

        def record(self):
            share, left = progress(self)
            told.append((len(self.thresholds), share, left))
            return share, left

        with patch.object(frame.Frame, "progress", record), recorded() as loop:
            picture, parts = rendered(scene)
        self.assertNotEqual(loop.settings[0][0], loop.settings[1][0])
        self.assertGreater(numpy.abs(parts[0][3] - parts[1][3]).max(), 0.01)
        for (*_, samples), (*_, counts) in zip(loop.settings, parts):
            # Cycles looks at its threshold after whole steps of 16 samples
            self.assertTrue((((counts % 16 == 0) & (counts >= 48)) | (counts == samples)).all(), numpy.unique(counts))
        # Unknown before the first verdict, and then it goes on
        self.assertEqual(told[:2], [(1, None, None)] * 2)
        for (one, before, _), (other, share, left) in zip(told[2:], told[3:]):
            self.assertTrue(one < other or before < share or share == 1, told)
            self.assertTrue(0 < share <= 1 and left >= 0, told)
        self.assertGreater(len(told), 3)
        wanted, count = mean(parts)
        # Sums of at most 4096 samples in some pictures, in float32
        numpy.testing.assert_allclose(picture, wanted, rtol=2e-6 * len(parts), atol=1e-6)
        self.assertGreater(count.max(), count.min(), "all pixels have as many samples: a scene that tests nothing")
        summary = hooks.state.summary
        self.assertRegex(summary, r"^(\d+) of \1 squares without visible noise \(90% of people, desk, ")
        self.assertIn(f"{count.min():.0f} to {count.max():.0f} samples per pixel", summary)
        self.assertNotIn("ended", summary)

    def test_only_places_that_fail_get_more_samples_and_each_as_many_as_it_needs(self):
        scene = room(closed=True)
        scene.noisefloor.max_samples, efforts = 1 << 20, []

        def excess(self, pair):
            """Two squares of a row, one four times as far from passing as the other, and one below that passes."""
            efforts.append(hooks.state.frame.effort.copy())
            ratio = lambda x, threshold: (threshold**-2 / efforts[-1][0, x // 32]) ** 0.5
            return excess_of([(0, 32, 64, 64, 0.5), *((x, 0, 32, 32, ratio(x, t)) for x, t in [(0, 0.06), (96, 0.12)])])

        with patch.object(judging.Judge, "excess", excess):
            _, parts = rendered(scene)
        self.assertGreater(len(efforts), 1)
        # Everything once, and then only what failed
        first, last = efforts[0][0, 0], efforts[-1]
        self.assertTrue((efforts[0] == first).all())
        self.assertTrue((last[1:] == first).all() and (last[0, 1:3] == first).all(), last)
        for region, *_ in parts[2:]:
            self.assertEqual((region[1], region[3]), (0, 32))
        # Both pass, and the better one with not much more than it needs
        self.assertGreaterEqual(last[0, 0] * 0.06**2, 1)
        self.assertTrue(1 <= last[0, 3] * 0.12**2 < 2.5, last)

    def test_a_gpu_is_called_for_few_parts_and_each_place_gets_what_it_needs(self):
        """Cycles' calls cost a GPU a start each. By a fake: the processor renders what a GPU would be called for."""
        scene, efforts, calls = room(closed=True), [], {}
        scene.noisefloor.max_samples = 1 << 20
        # Single cells here and there, each with a need of its own
        wanted = {place: 0.2 * 0.9**number for number, place in enumerate([(0, 0), (0, 3), (1, 1), (2, 0), (2, 3)])}

        def excess(self, pair):
            efforts.append(hooks.state.frame.effort.copy())
            ratio = lambda place: (wanted[place] ** -2 / efforts[-1][place]) ** 0.5
            return excess_of([(32 * x, 32 * y, 32, 32, ratio((y, x))) for y, x in wanted])

        for device in (None, "CUDA"):
            with patch.object(judging.Judge, "excess", excess), patch.object(denoise, "gpu", lambda scene: device):
                _, calls[device] = rendered(scene)
            for place, threshold in wanted.items():
                self.assertGreaterEqual(efforts[-1][place] * threshold**2, 1)
        self.assertGreaterEqual(len(calls[None]), 2 + 2 * len(wanted))
        self.assertLess(len(calls["CUDA"]), len(calls[None]))

    def test_how_many_samples_a_share_is_follows_from_all_shares(self):
        random = numpy.random.default_rng(8)
        for samples in (16, 100, 640, 5000):
            for _ in range(20):
                most = int(random.integers(1, samples // 16 + 1)) * 16 if samples > 100 else samples
                counts = numpy.minimum(random.integers(1, most // 16 + 2, (9, 7, 1)) * 16, most)
                counts[0, 0], counts[1, 1] = most, min(16, most)
                shares = (counts / most).astype(numpy.float32)
                found = sampling.counts(shares, 14, 0.1, samples)
                # Of several that fit, the fewest: all of them are in the same ratio
                self.assertTrue((found * most == counts * found.max()).all() and found.max() <= most, (most, samples))

    def test_passes_maps_summary_and_metadata_are_left(self):
        scene = room()
        layer = scene.view_layers[0]
        layer.use_pass_z = layer.use_pass_normal = layer.use_pass_cryptomatte_object = True
        picture, parts = rendered(scene)
        exr = pathlib.Path(scene.render.filepath + ".exr").read_bytes()
        # Who looks, how it is shown, and the thresholds
        for words in (b"squares without visible noise", b"95% of people, desk, ", b"thresholds 0.283"):
            self.assertIn(words, exr)
        layers = passes_in_file(scene)
        for name in ["Combined", "Depth", "Normal", "CryptoObject00", "noisefloor Samples", "noisefloor Visible Noise"]:
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
        scene = room(closed=True)
        scene.noisefloor.max_samples, scene.noisefloor.people = 96, 0.99
        picture, parts = rendered(scene)
        self.assertEqual(mean(parts)[1].max(), 96)
        self.assertIn("ended: max-spp", hooks.state.summary)
        scene.noisefloor.max_samples, scene.noisefloor.time_limit = 1 << 15, 4
        scene.cycles.adaptive_min_samples = 1 << 14
        picture, parts = rendered(scene)
        numpy.testing.assert_allclose(picture, mean(parts)[0], rtol=1e-5, atol=1e-6)
        # Both halves had their share of the time, and no more
        self.assertEqual([half for _, half, *_ in parts], [0, 1])
        self.assertIn("ended: time-limit", hooks.state.summary)
        scene.noisefloor.time_limit, calls = 0, []
        scene.cycles.adaptive_min_samples = 0

        for pictures in (1, 2):

            def esc(self):
                calls.append(None)
                return len(calls) >= pictures

            calls.clear()
            with patch.object(frame.Frame, "_cancelled", esc):
                picture, parts = rendered(scene)
            # One that was stopped counts only where there is nothing better
            self.assertEqual(len(parts), pictures)
            numpy.testing.assert_allclose(picture, mean(parts)[0], rtol=1e-5, atol=1e-6)
            self.assertIn("ended: cancelled", hooks.state.summary)

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
        with patch.object(settings, "params", record):
            for animated in (False, True):
                scene.cycles.use_animated_seed = animated
                bpy.ops.render.render(animation=True)
                self.assertEqual("23.976 frames a second" in hooks.state.summary, animated, hooks.state.summary)
            both = [pixels(scene.render.frame_path(frame=frame_number)) for frame_number in (1, 2)]
            scene.frame_set(2)
            alone = rendered(scene)[0]
        # Each frame has a seed of its own, whatever was rendered before it
        assert_same(both[1], alone, 192)
        self.assertGreater(numpy.abs(both[0] - both[1]).max(), 0.01)
        self.assertEqual(judged, [None, None, 23.976, 23.976, None])

    def test_denoised_pictures_are_judged_as_such_and_the_noisy_one_is_kept(self):
        scene = room(closed=True)
        scene.noisefloor.max_samples, scene.cycles.use_denoising = 8192, True
        self.needs_denoiser()
        picture, parts = rendered(scene)
        self.assertIn("denoised by Open Image Denoise, at most 0.3 JOD lost", hooks.state.summary)
        denoised, noisy = mean(parts)[1].mean(), mean(parts)[0]
        self.assertIn("noisefloor jod lost", bpy.data.images)
        layers = passes_in_file(scene)
        for name in ["Combined", "Noisy Image", "Denoising Albedo", "noisefloor JOD Lost", "noisefloor Samples"]:
            self.assertIn(f".{name}.".encode(), layers)

        def roughness(image):
            return numpy.abs(numpy.diff(image[..., 1], axis=1)).mean()

        self.assertLess(roughness(picture), 0.8 * roughness(noisy))
        self.assertLess(abs(picture[..., :3].mean() / noisy[..., :3].mean() - 1), 0.02)
        # What the denoiser removes needs no samples
        scene = room(closed=True)
        scene.noisefloor.max_samples = 8192
        self.assertLess(denoised, 0.7 * mean(rendered(scene)[1])[1].mean())

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
            table = display.table(scene)
            kept = settings.file_format, settings.color_depth
            settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
            image.save_render(str(FOLDER / "shown.png"), scene=scene)
            settings.file_format, settings.color_depth = kept
            shown = pixels(FOLDER / "shown.png")[::-1].reshape(-1, 4)[:, :3]
            found, _, _ = looked_up(table, radiance[:, :3])
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
        scene.noisefloor.max_samples = 4096
        for exposure in (-6, 0):
            scene.view_settings.exposure = exposure
            rendered(scene)
            samples.append(float(hooks.state.summary.split(" samples per pixel, ")[1].split(" on average")[0]))
        # Noise that is shown as black is not seen
        self.assertLess(samples[0], 0.7 * samples[1])

    def test_a_threshold_is_found_and_nothing_else_changes(self):
        scene = room(closed=True)
        scene.cycles.samples = 4096
        self.search(scene)
        found = scene.cycles.adaptive_threshold
        # Other seeds, through the panel's own way: what was found passes, and thrice as much does not
        ratios = []
        for threshold in (found, 3 * found):
            pair = []
            for seed in (101, 202):
                scene.cycles.adaptive_threshold, scene.cycles.seed = threshold * 2**0.5, seed
                scene.noisefloor.use = False
                pair.append(rendered(scene)[0][..., :3])
            params = settings.params(scene, display.table(scene))
            ratios.append(noisefloor.excess(*pair, params=params).ratio)
        self.assertLess(ratios[0], 1.2)
        self.assertGreater(ratios[1], 1.2)

    def test_a_search_is_one_step_to_undo(self):
        room().cycles.samples = 512
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.ed.undo_push(message="before")
            before = facts(bpy.context.scene)
            self.assertEqual(bpy.ops.render.noisefloor_threshold("EXEC_DEFAULT", True), {"FINISHED"})
            self.assertNotEqual(facts(bpy.context.scene), before)
            bpy.ops.ed.undo()
        self.assertEqual(facts(bpy.context.scene), before)

    def test_a_search_that_is_stopped_leaves_all_as_it_was(self):
        """By Esc, which ends a picture, and by the cross, after it."""
        scene, operator = room(), tune.RENDER_OT_noisefloor_threshold
        for stop in ("esc", "cross"):
            before = facts(scene)
            search = hooks.state.search = tune.Search(scene)
            search.advance()
            self.assertNotEqual(facts(scene), before)
            self.assertEqual(bpy.ops.render.noisefloor_stop() if stop == "cross" else {"FINISHED"}, {"FINISHED"})
            hooks.state.ended = "completed" if stop == "cross" else "cancelled"
            own = types.SimpleNamespace(search=search, timer=None)
            own.end = types.MethodType(operator.end, own)
            self.assertEqual(operator.modal(own, MagicMock(), types.SimpleNamespace(type="TIMER")), {"CANCELLED"})
            self.assertIsNone(hooks.state.search)
            self.assertEqual(facts(scene), before)

    def test_shots_of_all_kinds_are_searched_rendered_and_judged_as_they_are_shown(self):
        for name, make in scenes.SCENES.items():
            with self.subTest(scene=name):
                scene = make()
                scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.seed = 1024, True, 3
                scene.render.filepath, shot = str(FOLDER / f"{name}.png"), scene.render.image_settings
                shot.file_format, shot.color_mode, shot.color_depth = "PNG", "RGB", "16"
                before = self.search(scene) | {("noisefloor", "use"): True}
                self.assertEqual("is the hardest of 2, at 24 frames" in hooks.state.summary, name == "film")
                scene.noisefloor.use = True
                with recorded() as loop:
                    bpy.ops.render.render(write_still=True)
                self.assertRegex(hooks.state.summary, r"^(\d+) of \1 squares without anything wrong")
                self.assertEqual(facts(scene), before)
                self.assertEqual(sorted(loop.made), sorted(layer.name for layer in scene.view_layers))
                if name == "layers":
                    continue  # What the compositor makes of them is not judged
                (made,) = loop.made.values()
                shown, _ = noisefloor.read(scene.render.filepath)
                found, least, most = looked_up(
                    display.table(scene), numpy.maximum(made["Combined"][..., :3].reshape(-1, 3), 0)
                )
                shown = shown[::-1].reshape(-1, 3) / 65535
                self.assertLessEqual(numpy.median(numpy.abs(found - shown)) * 255, 1, name)
                # Where a channel rises or falls with each of the three, it lies between the entries around it, also where
                # colours that the display lacks meet its edge
                outside = numpy.maximum(least - shown, shown - most) * 255
                self.assertLessEqual(numpy.quantile(outside, 0.99), 1, name)

    def test_drivers_and_keys_of_what_is_borrowed_change_nothing(self):
        found, said = [], []

        def keys(scene):
            scene.cycles.keyframe_insert("seed", frame=1)
            scene.cycles.adaptive_threshold = 0.05
            scene.cycles.keyframe_insert("adaptive_threshold", frame=1)

        for animate in (
            lambda scene: None,
            lambda scene: setattr(scene.driver_add("cycles.seed").driver, "expression", "frame"),
            keys,
        ):
            scene = room()
            scene.cycles.samples, scene.cycles.seed = 512, scene.frame_current
            animate(scene)
            self.assertEqual(bpy.ops.render.noisefloor_threshold(), {"FINISHED"})
            found.append(scene.cycles.adaptive_threshold)
            said.append("Noise Threshold has keys" in hooks.state.summary)
        self.assertEqual(found[1:], found[:1] * 2)
        # Those of the threshold itself will overwrite what was found
        self.assertEqual(said, [False, False, True])

    def test_passes_prefilter_and_quality_of_the_denoiser_are_cycles_own(self):
        """The denoised picture of the add-on is that of Cycles, of the same samples."""
        self.needs_denoiser()
        scene, made = room(), {}
        cycles = scene.cycles
        scene.noisefloor.use, cycles.use_denoising = False, True
        scene.view_layers[0].cycles.denoising_store_passes = True
        for how in [
            ("RGB_ALBEDO_NORMAL", "ACCURATE", "HIGH"),
            ("RGB_ALBEDO_NORMAL", "ACCURATE", "FAST"),
            ("RGB_ALBEDO_NORMAL", "FAST", "HIGH"),
            ("RGB_ALBEDO_NORMAL", "NONE", "BALANCED"),
            ("RGB_ALBEDO", "ACCURATE", "HIGH"),
            ("RGB", "FAST", "HIGH"),
        ]:
            cycles.denoising_input_passes, cycles.denoising_prefilter = how[:2]
            if hasattr(cycles, "denoising_quality"):
                cycles.denoising_quality = how[2]
            elif how[2] != "HIGH":
                continue
            with recorded() as plain:
                bpy.ops.render.render()
            (found,) = plain.cycles["ViewLayer"]
            judge = judging.Judge(scene, display.table(scene), None, True, False)
            made[how] = judge.denoise({**found, "Combined": found["Noisy Image"]})
            # Sums of float32 in the layers of a network, in any order
            numpy.testing.assert_allclose(made[how], found["Combined"], rtol=1e-4, atol=1e-4, err_msg=str(how))
        for one, other in itertools.combinations(made.values(), 2):
            self.assertGreater(numpy.abs(one - other).max(), 1e-3)

    def test_a_threshold_for_marked_frames_is_that_of_the_hardest(self):
        scene = room(closed=True)
        scene.cycles.samples, scene.frame_start, scene.frame_end = 4096, 1, 20
        # The others are so dark that little is seen in them
        lamp, seen = bpy.data.lights["Light"], []
        for frame_number, energy in [(5, 20), (10, 1000), (15, 50)]:
            lamp.energy = energy
            lamp.keyframe_insert("energy", frame=frame_number)
        scene.noisefloor.frames, scene.noisefloor.people = "markers", 0.8
        scene.frame_set(7)
        with self.assertRaisesRegex(RuntimeError, "no frame between"):
            bpy.ops.render.noisefloor_threshold()
        for frame_number in (5, 10, 15, 99):
            scene.timeline_markers.new(f"mark {frame_number}", frame=frame_number)
        with before_each_render(lambda scene: seen.append(scene.frame_current)):
            self.search(scene)
        # Two pictures of each with the first setting, and then the hardest first
        self.assertEqual(seen[:6], [5, 5, 10, 10, 15, 15])
        self.assertEqual(seen[6:8], [10, 10])
        self.assertIn("frame 10 is the hardest of 3", hooks.state.summary)
        found = scene.cycles.adaptive_threshold
        # In one film, noise that is new in every frame may be stronger
        scene.cycles.use_animated_seed = True
        bpy.ops.render.noisefloor_threshold()
        self.assertIn("at 24 frames a second", hooks.state.summary)
        self.assertGreater(scene.cycles.adaptive_threshold, found)

    def test_crops_stand_for_a_large_picture_between_looks_at_the_whole(self):
        scene = room(closed=True)
        scene.cycles.samples, scene.noisefloor.people = 4096, 0.5
        scene.render.resolution_x, scene.render.resolution_y = 256, 200
        seen = []

        def record(scene):
            shot = scene.render
            wide = round(256 * (shot.border_max_x - shot.border_min_x)) if shot.use_border else 256
            seen.append((wide, shot.use_persistent_data))

        with before_each_render(record):
            self.search(scene)
        widths = [wide for wide, _ in seen]
        # The whole has the first and the last word; where it is not satisfied with what was found in crops, it has one between
        self.assertEqual((widths[:2], set(widths), widths[-2:]), ([256] * 2, {128, 256}, [256] * 2))
        self.assertLessEqual(widths.count(256), 6)
        self.assertTrue(all(persistent for _, persistent in seen))

    def test_a_search_that_finds_nothing_says_why(self):
        scene = room(closed=True)
        # So few samples that no threshold is reached
        scene.cycles.samples = 8
        before = facts(scene)
        with self.assertRaisesRegex(RuntimeError, "Max Samples"):
            bpy.ops.render.noisefloor_threshold()
        self.assertEqual(facts(scene), before)

    def test_what_one_picture_leaves_is_what_it_leaves(self):
        """Predicted of a finer threshold, and looked at."""
        scene, params = room(closed=True), None
        scene.noisefloor.use, scene.cycles.samples, scene.cycles.use_adaptive_sampling = False, 4096, True
        scene.view_layers[0].cycles.pass_debug_sample_count = True
        params = settings.params(scene, display.table(scene))

        def pair(threshold, fewest=0):
            scene.cycles.adaptive_threshold, scene.cycles.adaptive_min_samples, found = threshold, fewest, []
            for scene.cycles.seed in (31, 32):
                with recorded() as plain:
                    bpy.ops.render.render()
                (found_passes,) = plain.cycles["ViewLayer"]
                found_passes[frame.COUNT] = sampling.counts(found_passes[frame.COUNT], fewest, threshold, 4096)
                found.append(found_passes)
            counts = (*(each[frame.COUNT][..., 0] for each in found), each, single, 4096)
            return found, noisefloor.excess(*(each["Combined"][..., :3] for each in found), params=params, counts=counts)

        single = sampling.least(0, 0.03 / 2**0.5, 4096)
        each, fewest = sampling.half(single)
        self.assertEqual((single, each, sampling.least(fewest, 0.03, 4096)), (64, 32, 32))
        pictures, coarse = pair(0.03, fewest)
        self.assertEqual(min(picture[frame.COUNT].min() for picture in pictures), 32)
        said = coarse.alone
        self.assertTrue(coarse.ratio <= said < 2**0.5 * coarse.ratio, (coarse.ratio, said))
        _, fine = pair(0.03 / 2**0.5)
        # Of one picture, √2 times what their mean has; seeds differ
        self.assertAlmostEqual(numpy.log(fine.ratio * 2**0.5 / said), 0, delta=0.25)

    def test_a_denoise_node_that_follows_is_noticed(self):
        scene = room()
        self.assertFalse(compositor.denoises(scene))
        tree, out = scenes.composited(scene)
        scene.render.use_compositing = True
        node = tree.nodes.new("CompositorNodeDenoise")
        self.assertFalse(compositor.denoises(scene), "nobody sees what it makes")
        tree.links.new(node.outputs[0], out.inputs[0])
        self.assertTrue(compositor.denoises(scene))
        for off in (lambda yes: setattr(node, "mute", yes), lambda yes: setattr(scene.render, "use_compositing", not yes)):
            off(True)
            self.assertFalse(compositor.denoises(scene))
            off(False)
        advice = "A" + compositor.ADVICE[1:]
        self.assertIn(advice, [text for _, text in drawn(scene)])
        scene.cycles.use_denoising = True
        self.assertNotIn(advice, [text for _, text in drawn(scene)])

    def test_the_panel_offers_the_loop_first_and_says_how_far_a_search_is(self):
        scene = room()
        scene.cycles.use_adaptive_sampling = True
        # Of other tests
        hooks.state.took.clear()
        hooks.state.tried.clear()
        offered = ["Still: Render until nobody sees noise", "Animation: Find Noise Threshold", "Takes one to five frames"]
        self.assertEqual([text for _, text in drawn(scene)], offered)
        scene.noisefloor.use = False
        bpy.ops.render.render()
        self.assertRegex(drawn(scene)[2][1], r"^Takes one to five frames, about 0:\d\d to 0:\d\d$")
        self.assertFalse(bpy.ops.render.noisefloor_stop.poll())
        shares, advance = [], tune.Search.advance

        def record(self):
            advance(self)
            hooks.state.search = self
            shares.append((len(self.search.steps), self.share(), self.left()))
            said = drawn(scene)
            assert [kind for kind, _ in said[:3]] == ["prop", "progress", "operator"], said
            assert "picture" in said[1][1], said
            hooks.state.search = None

        scene.cycles.samples = 4096
        with patch.object(tune.Search, "advance", record):
            bpy.ops.render.noisefloor_threshold()
        self.assertGreater(len(shares), 1)
        self.assertTrue(all(0 <= share <= 1 for _, share, _ in shares), shares)
        self.assertTrue(all(left is None or left >= 0 for *_, left in shares), shares)
        self.assertEqual(shares[-1][1:], (0.0, None))
        # What other thresholds leave and take, from coarse to fine, and the one that was found
        bars = [text for kind, text in drawn(scene) if kind == "progress"]
        thresholds = [float(text.split(":")[0]) for text in bars]
        self.assertEqual(thresholds, sorted(thresholds, reverse=True))
        (found,) = (text for text in bars if text.endswith(" (found)"))
        self.assertTrue(found.startswith(f"{scene.cycles.adaptive_threshold:.3g}: "), bars)
        self.assertRegex(found, r": (0\.\d\d|1\.00) of what may be seen, \d+ s ")

    def test_gpus_are_used_as_the_scene_says(self):
        """By fakes: there is no GPU here."""
        self.needs_denoiser()
        scene, library = room(), denoise.library()
        scene.cycles.use_denoising = scene.cycles.denoising_use_gpu = True
        self.assertIsNone(denoise.gpu(scene))
        self.assertEqual(denoise.device(scene, library), (denoise.CPU, None))
        with patch.object(denoise, "gpu", lambda scene: "CUDA"):
            kind, note = denoise.device(scene, library)
            self.assertEqual(kind, denoise.CPU)
            self.assertIn("the processor denoises: Open Image Denoise", note)
            scene.render.resolution_x, scene.render.resolution_y = 640, 480
            self.assertIsNone(searched(scene))
        self.assertEqual(searched(scene), (640, 480))
        # What a GPU gets by way of its own memory, and keeps for the next picture, is what the processor reads where it lies:
        # from the bottom, beside an alpha that is left alone
        random = numpy.random.default_rng(4)
        with_alpha = [numpy.float32(random.uniform(0, 1, (64, 96, 4)))[::-1] for _ in range(3)]
        one, albedo, other = (picture[..., :3] for picture in with_alpha)
        normal = numpy.float32(random.uniform(-1, 1, (64, 96, 3)))
        own, away = (denoise.Denoiser(library, denoise.CPU, shared) for shared in (True, False))
        for colour, *guides in [(one,), (one, albedo, normal), (other, albedo, normal), (other[8:40],), (one,)]:
            made = own.denoise(colour, *guides)
            numpy.testing.assert_array_equal(made, away.denoise(colour, *guides))
            self.assertGreater(numpy.abs(made - colour).mean(), 0.01)
            upright = [numpy.ascontiguousarray(picture[::-1]) for picture in (colour, *guides)]
            numpy.testing.assert_array_equal(made, denoise.Denoiser(library).denoise(*upright)[::-1])
        with self.assertRaisesRegex(RuntimeError, "Open Image Denoise: "):
            own.denoise(one, None, normal)


def searched(scene):
    """The size of the pictures in which a search may look at parts; None if it may not."""
    with patch.object(noisefloor, "Search") as search:
        tune.Search(scene).end()
    return search.call_args.kwargs["size"]


def drawn(scene):
    """What the panel draws beside Cycles' own field: kinds and texts."""
    layout = MagicMock()
    layout.column.return_value = layout.row.return_value = layout
    tune.draw(types.SimpleNamespace(layout=layout), types.SimpleNamespace(scene=scene))
    made = [call for call in layout.method_calls if call[0] not in ("column", "row")]
    return [(kind, words["text"] if "text" in words else names[1]) for kind, names, words in made]


arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
zipfile.ZipFile(arguments[0]).extractall(FOLDER)
sys.path[:0] = [str(FOLDER), str(pathlib.Path(__file__).resolve().parent)]
import noisefloor_addon
import noisefloor
import scenes
from noisefloor_addon import compositor, denoise, display, frame, hooks, judging, passes, sampling, settings, tune

noisefloor_addon.register()
result = unittest.main(argv=["test_addon.py", *arguments[1:]], exit=False).result
noisefloor_addon.unregister()
WORK.cleanup()
sys.stdout.flush()
# Blender as a module may crash while Python ends
os._exit(0 if result.wasSuccessful() else 1)
