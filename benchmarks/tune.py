#!/usr/bin/env python3
"""Cycles' noise threshold: defaults, guesses, fixed samples, what Find Noise Threshold finds, and the add-on's own loop,
for docs/benchmarks/blender.md.

    tune.py render ADDON.zip SCENE WIDTHxHEIGHT FOLDER [REFERENCE_SPP [SEEDS [DEVICE]]]   in an environment that has bpy
    tune.py measure FOLDER...                                                       pip install cvvdp pillow
    tune.py small FOLDER...

SCENE is a .blend file or one of the add-on's, as in scenes.py:hair. Of its small ones, only what is found, Cycles' default and the loop
are rendered; `small` has the table of these.

`render` writes what Blender shows (view transform included) as PNGs of 16 bits, denoised by Cycles' own Open Image
Denoise, two seeds a setting unless said otherwise, beside times.json with the processor seconds of each render and of the search,
or the wall seconds if DEVICE is OPTIX, CUDA, HIP, ONEAPI or METAL, which then denoises, too; it goes on where it was interrupted. `measure`
says what the worst square of 64 pixels, side by side, has lost against the reference, by the package `cvvdp`, no code of this project: on
average over two seeds, and of the worse one."""
import json
import pathlib
import resource
import runpy
import statistics
import sys
import tempfile
import time
import zipfile

from figures import table

THRESHOLDS, DEFAULT, SAMPLES = (0.2, 0.1, 0.05, 0.03), 0.01, (64, 256)


def render(addon, path, size, folder, reference=4096, seeds=2, device="CPU"):
    reference, seeds = int(reference), int(seeds)
    import bpy

    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    width, height = map(int, size.split("x"))
    unpacked = tempfile.mkdtemp()
    zipfile.ZipFile(addon).extractall(unpacked)
    sys.path.insert(0, unpacked)
    import noisefloor_addon

    noisefloor_addon.register()
    path, _, name = path.partition(":")
    scenes = runpy.run_path(path) if name else {"SCENES": ()}
    small = name in scenes["SCENES"]
    if name:
        scenes["SCENES" if small else "LARGER"][name]()
    else:
        bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    cycles, shot, settings = scene.cycles, scene.render, scene.render.image_settings
    cycles.device, cycles.use_denoising, scene.noisefloor.use = "CPU", True, False
    if device != "CPU":
        own = bpy.context.preferences.addons["cycles"].preferences
        own.compute_device_type = device
        for each in own.get_devices_for_type(device):
            each.use = each.type == device
        cycles.device, cycles.denoising_use_gpu = "GPU", True
    shot.resolution_x, shot.resolution_y, shot.resolution_percentage = width, height, 100
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "16"
    times = folder / "times.json"
    done = json.loads(times.read_text()) if times.exists() else {"device": device}
    if device != "CPU":
        # Kernels and the denoiser wake up
        cycles.use_adaptive_sampling, cycles.samples = False, 8
        bpy.ops.render.render()

    used = time.time if device != "CPU" else lambda: resource.getrusage(resource.RUSAGE_SELF).ru_utime

    def one(kind, value, seed):
        name = f"{kind}-{value:g}-{seed}"
        if name in done:
            return
        cycles.use_adaptive_sampling, cycles.seed = kind != "samples", seed
        scene.noisefloor.use, scene.noisefloor.write_maps = kind == "loop", False
        cycles.adaptive_threshold, cycles.samples = (value, 4096) if kind != "samples" else (0.01, int(value))
        before, begun = used(), time.time()
        bpy.ops.render.render()
        done[name] = {"user": used() - before, "wall": time.time() - begun}
        if kind == "loop":
            done[name]["said"] = noisefloor_addon.hooks.state.summary
        bpy.data.images["Render Result"].save_render(str(folder / f"{name}.png"), scene=scene)
        times.write_text(json.dumps(done, indent=1))
        print(name, done[name], flush=True)

    if "search" not in done:
        cycles.use_adaptive_sampling, cycles.seed, cycles.adaptive_threshold, cycles.samples = True, 3, 0.01, 4096
        before = used()
        try:
            bpy.ops.render.noisefloor_threshold()
            found = cycles.adaptive_threshold
        except RuntimeError as error:
            print(error)
            found = None
        done["search"] = {"user": used() - before, "found": found, "said": noisefloor_addon.hooks.state.summary}
        times.write_text(json.dumps(done, indent=1))
        print("search", done["search"], flush=True)

    # The dear ones last, so that an interrupted run has the others of both seeds
    for seed in range(1, seeds + 1):
        one("loop", 0, seed)
        if done["search"]["found"]:
            one("tuned", done["search"]["found"], seed)
        for threshold in () if small else THRESHOLDS:
            one("threshold", threshold, seed)
    one("samples", reference, 77)
    for seed in range(1, seeds + 1):
        one("threshold", DEFAULT, seed)
    for samples in () if small else SAMPLES:
        one("samples", samples, 1)


def label(name):
    """The ledger's name of a row: `threshold-0.01-1` and the like."""
    kind, value, _ = name.split("-")
    named = {"loop": "the loop", "tuned": "the threshold found", "samples": f"{value} samples", "threshold": f"threshold {value}"}[kind]
    return named + (", Cycles' default" if (kind, value) == ("threshold", "0.01") else "")


def losses(folder):
    """By the names of settings: what the worst square has lost, for each seed."""
    import numpy
    import pycvvdp
    from PIL import Image

    metric = pycvvdp.cvvdp(display_name="standard_fhd", quiet=True)

    def read(path):
        return numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float32) / 255

    def places(side):
        return [*range(0, max(side - 64, 0), 64), max(side - 64, 0)]

    def worst(path):
        picture = read(path)
        squares = [(slice(y, y + 64), slice(x, x + 64)) for y in places(picture.shape[0]) for x in places(picture.shape[1])]
        return max(10 - float(metric.predict(picture[s], reference[s], dim_order="HWC")[0]) for s in squares)

    reference, found = read(next(folder.glob("samples-*-77.png"))), {}
    for path in sorted(folder.glob("*-[12].png")):
        found.setdefault(path.stem[:-2], []).append(worst(path))
    return found


def seconds(done, setting):
    """What a render with this setting takes, on average over seeds."""
    return f"{statistics.mean(done[each]['user'] for each in done if each[:-2] == setting):.3g}"


def jods(lost):
    return f"{statistics.mean(lost):.2f}" + (f" ({max(lost):.2f})" if len(lost) > 1 else "")


def measure(folders):
    rows, heads, name = {}, [], "blender"
    for folder in map(pathlib.Path, folders):
        done, lost = json.loads((folder / "times.json").read_text()), losses(folder)
        name = "blender" if done["device"] == "CPU" else "blender-gpu"
        print(f"{folder.name}: {done['search']}", file=sys.stderr)
        heads += [f"{folder.name}: seconds", f"{folder.name}: JOD lost"]
        for setting in [each[:-2] for each in done if each.endswith("-1")]:
            row = rows.setdefault(label(setting + "-1"), {})
            row[heads[-2]], row[heads[-1]] = seconds(done, setting), jods(lost[setting])
    table(name, heads, [[setting, *(row.get(head, "") for head in heads)] for setting, row in rows.items()])


def small(folders):
    rows = []
    for folder in map(pathlib.Path, folders):
        done, lost = json.loads((folder / "times.json").read_text()), losses(folder)
        found = done["search"]["found"]
        rows.append([folder.name, f"{found:.3g}" if found else "none", f"{done['search']['user']:.3g}"])
        for setting in (f"tuned-{found or 0:g}", "threshold-0.01", "loop-0"):
            rows[-1].append(f"{seconds(done, setting)}, {jods(lost[setting])}" if setting in lost else "none")
    table("blender-small", ["threshold found", "search, seconds", "frame: seconds, JOD", "Cycles' default", "the loop"], rows)


if __name__ == "__main__":
    if sys.argv[1:2] == ["render"]:
        addon, scene, size, folder, *more = sys.argv[2:]
        render(addon, scene, size, folder, *more)
    elif sys.argv[1:2] in (["measure"], ["small"]):
        globals()[sys.argv[1]](sys.argv[2:])
    else:
        raise SystemExit(__doc__)
