#!/usr/bin/env python3
"""How near frames of films, judged one by one, come to the package `cvvdp` in video mode (no code of this project but its
command, which is what is measured).

    pip install cvvdp==0.5.7 OpenEXR pillow
    benchmarks/film.py render FOLDER NOISEFLOOR     renders that are there are kept; on two cores an hour
    benchmarks/film.py table FOLDER NOISEFLOOR
    benchmarks/film.py stop FOLDER NOISEFLOOR       what films have lost where they stop, beside stills; on two cores an hour
    benchmarks/film.py denoised FOLDER NOISEFLOOR   needs mitsuba-oidn==0.1.2 as well
    benchmarks/film.py camera FOLDER NOISEFLOOR     cameras that move, in scenes of moving.py; on two cores an hour
    benchmarks/film.py forecast FOLDER NOISEFLOOR   what sequences take and what was forecast; needs only numpy

Frames are renders of a still view with one seed each. The truth is the mean of all of them, each by its samples. All are
shown by Reinhard's operator at the exposure of the truth, in 8 bits. Of a film, what is lost is pooled over its frames as
the package does, after the first quarter of a second, in which the package sees the first frame standing still."""
import csv, json, math, pathlib, subprocess, sys, tempfile
import numpy as np

SCENES = {s: (16, 48, 128) for s in ("cornell-box", "arcade")}
SCENES |= {s: (48,) for s in ("bulb", "softbox", "courtyard", "door-ajar", "glass-spheres", "plates")}
FRAMES, EDGE, RATES = 30, 192, (24, 25, 30, 60)
# Frames that are judged one by one
JUDGED = 6
DISPLAY = "standard_fhd"
# From the mean observer to 95 % of people, in samples (`noisefloor inspect`); only a scale here
TO_95 = 2.6

task, folder, program = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3]
renders = [(scene, spp, seed) for scene in SCENES for spp in SCENES[scene] for seed in range(1, FRAMES + 1)]

if task == "render":
    for scene, spp, seed in renders:
        out = folder / f"{scene}-{spp}-{seed}"
        if not (out / "image.exr").exists():
            size, stop = f"{EDGE}x{EDGE}", ["--criterion", f"spp:{spp}", "--max-spp", str(spp), "--autosave", "0"]
            subprocess.run([program, "render", scene, "--size", size, *stop, "--seed", str(seed), "--quiet", "--force",
                            "--out", str(out)], check=True)
    sys.exit()

if task == "forecast":
    # Twelve sequences whose camera moves, two seeds each: a forecast first, then the rest of the frames
    from moving import MOVES, SCENES as MOVING, write_frames

    count, size, rows, by_small = 24, "96x96", [], []

    def spread(few):
        """So many frames at equal distances, counted from 0."""
        return np.floor(np.arange(few) * (count - 1) / (few - 1) + 0.5).astype(int)

    def by_lines(values, few):
        known = spread(few)
        return np.interp(np.arange(count), known, values[known]).sum()

    for scene, move, seed in ((s, m, seed) for s in MOVING for m in MOVES for seed in (1, 2)):
        out, pattern = folder / f"{scene}-{move}-{seed}", write_frames(folder / "scenes", scene, move, count)
        common = [program, "render", "--frames", f"1-{count}", pattern, "--fps", "24", "--max-spp", "4000", "--seed",
                  str(seed), "--quiet", "--resume"]
        sequence = [*common, "--size", size, "--tile", "48", "--out", str(out)]
        if not (out / "forecast.json").exists():
            subprocess.run([*sequence, "--forecast"], check=True, stderr=subprocess.DEVNULL)
        subprocess.run(sequence, check=True, stderr=subprocess.DEVNULL)
        said = json.loads((out / "forecast.json").read_text())
        # The same from frames of half the width and height
        small = folder / f"{out.name}-small"
        if not (small / "forecast.json").exists():
            subprocess.run([*common, "--size", "48x48", "--tile", "24", "--out", str(small), "--forecast"], check=True,
                           stderr=subprocess.DEVNULL)
        smaller = json.loads((small / "forecast.json").read_text())["spp"]["expected"]
        # What it took: by the tiles of stops.csv, which are all of one size, and by the reports
        spp, seconds = np.zeros(count), np.zeros(count)
        for i in range(count):
            frame = out / f"{i + 1:04}"
            with open(frame / "stops.csv") as file:
                spp[i] = np.mean([int(tile["spp"]) for tile in csv.DictReader(file)])
            report = json.loads((frame / "report.json").read_text())
            assert report["samples"] == spp[i] * report["width"] * report["height"] and report["complete"]
            seconds[i] = sum(report[f"seconds_{part}"] for part in ("before", "setup", "total"))
        assert said["known"] == list(spread(5) + 1)
        # The forecast once more, from the same frames
        for kind, values in (("spp", spp / count), ("seconds", seconds)):
            assert math.isclose(by_lines(values, 5), said[kind]["expected"], rel_tol=1e-9), (out, kind)
        rows.append((f"{scene}, {move}", seed, said, spp, seconds))
        by_small.append(smaller / spp.mean())
        print(f"{out.name}: {said['spp']['expected']:.1f} spp, took {spp.mean():.1f}", file=sys.stderr, flush=True)

    print("| camera | seed | samples per pixel: least, most of a frame | forecast: range | took | off by |"
          " seconds: forecast, took | off by |")
    print("|---|---|---|---|---|---|---|---|")
    for name, seed, said, spp, seconds in rows:
        of, time = said["spp"], said["seconds"]
        print(f"| {name} | {seed} | {spp.min():.0f}, {spp.max():.0f} | {of['expected']:.0f}: {of['low']:.0f} to "
              f"{of['high']:.0f} | {spp.mean():.0f} | ×{of['expected'] / spp.mean():.2f} | {time['expected']:.0f}, "
              f"{seconds.sum():.0f} | ×{time['expected'] / seconds.sum():.2f} |")
    off = lambda found, took: math.exp(abs(math.log(found / took)))
    print("\n| frames | samples: within ×1.25, on average, at most | seconds: within ×1.25, on average, at most |\n|---|---|---|")
    for few in (3, 5, 7, 9):
        cells = []
        for kind in (3, 4):
            factors = np.array([off(by_lines(row[kind], few), row[kind].sum()) for row in rows])
            mean = math.exp(np.mean(np.log(factors)))
            cells.append(f"{(factors <= 1.25).sum()} of {len(rows)}, ×{mean:.3f}, ×{factors.max():.3f}")
        print(f"| {few} of {count} | {' | '.join(cells)} |")
    within = [sum(row[2][kind]["low"] <= took <= row[2][kind]["high"] for row, took in
                  ((row, row[of].mean() if kind == "spp" else row[of].sum()) for row in rows))
              for kind, of in (("spp", 3), ("seconds", 4))]
    widths = [math.exp(np.mean([math.log(row[2][kind]["high"] / row[2][kind]["low"]) / 2 for row in rows]))
              for kind in ("spp", "seconds")]
    print(f"\nWithin the range: samples {within[0]}, seconds {within[1]} of {len(rows)}. Half a range is ×{widths[0]:.2f} "
          f"and ×{widths[1]:.2f} on average.")
    print(f"From small frames, samples are off by ×{math.exp(np.mean(np.log(by_small))):.2f} on average, "
          f"×{min(by_small):.2f} to ×{max(by_small):.2f}; within ×1.25: {sum(off(f, 1) <= 1.25 for f in by_small)}.")
    sys.exit()

import OpenEXR, torch, pycvvdp
from PIL import Image

torch.set_num_threads(1)
metric = pycvvdp.cvvdp(display_name=DISPLAY, quiet=True, device=torch.device("cpu"))
weights = np.array([0.2126, 0.7152, 0.0722])


def linear(out):
    channels = OpenEXR.File(str(out / "image.exr")).channels()
    if "RGB" in channels:
        return np.asarray(channels["RGB"].pixels, dtype=np.float64)[..., :3]
    return np.stack([np.asarray(channels[c].pixels, dtype=np.float64) for c in "RGB"], axis=-1)


def read(scene, spp, seed):
    return linear(folder / f"{scene}-{spp}-{seed}")


def shown(linear, exposure):
    """Reinhard et al. 2002, eq. 3, then sRGB in 8 bits."""
    exposed = np.maximum(linear, 0) * exposure
    light = np.clip(exposed / (1 + exposed @ weights)[..., None], 0, 1)
    code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * code).astype(np.uint8)


def still(test, reference):
    return 10 - float(metric.predict(test / np.float32(255), reference / np.float32(255), dim_order="HWC")[0])


def film(frames, references, rate):
    """JODs lost after the first quarter of a second."""
    as_code = lambda pictures: np.ascontiguousarray(np.asarray(pictures) / np.float32(255))
    _, stats = metric.predict(as_code(frames), as_code(references), dim_order="FHWC", frames_per_second=rate)
    lost = torch.as_tensor(stats["Q_per_ch"])[:, :, 2 * math.ceil(0.25 * rate / 2):]
    return 10 - float(metric.do_pooling_and_jods(lost))


def here(frames, references, viewing):
    """JODs lost by frames judged one by one, on average: by the command."""
    lost = []
    with tempfile.TemporaryDirectory() as scratch:
        test, reference = (pathlib.Path(scratch) / name for name in ("test.png", "reference.png"))
        for one, truth in zip(frames, references):
            Image.fromarray(one).save(test)
            Image.fromarray(truth).save(reference)
            said = subprocess.run([program, "metrics", str(test), str(reference), "--json", "--viewing", viewing],
                                  check=True, capture_output=True, text=True).stdout
            lost.append(10 - json.loads(said)["cvvdp_jod"])
    return float(np.mean(lost))


def weaker(test, reference, contrast):
    return np.clip(np.round(reference + contrast * (test.astype(np.float64) - reference)), 0, 255).astype(np.uint8)


def contrast_of(test, reference, lost):
    """The contrast of the noise at which a still loses as much."""
    low, high = 0.1, 2.0
    for _ in range(9):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if still(weaker(test, reference, middle), reference) < lost else (low, middle)
    return math.sqrt(low * high)


def truth_of(scene):
    """The mean of all renders, what it looks like, and at which exposure."""
    levels = SCENES[scene]
    pictures = {spp: [read(scene, spp, seed) for seed in range(1, FRAMES + 1)] for spp in levels}
    truth = sum(spp * np.sum(of, axis=0) for spp, of in pictures.items()) / (FRAMES * sum(levels))
    exposure = 0.18 / math.exp(np.mean(np.log(truth @ weights + 1e-6)))
    return pictures, shown(truth, exposure), exposure


if task == "camera":
    from moving import write_frames

    count, edge, converged, levels, rate = 48, 96, 512, (16, 48), 24.0

    def rendered(pattern, frame, seed, spp):
        """Linear pictures of a frame."""
        name = f"{pathlib.Path(pattern).name.split('.')[0]}-{frame}-{seed}-{spp}"
        out = folder / name
        if not (out / "image.exr").exists():
            subprocess.run([program, "render", pattern.replace("{frame:04}", f"{frame:04}"), "--size", f"{edge}x{edge}",
                            "--criterion", f"spp:{spp}", "--max-spp", str(spp), "--autosave", "0", "--seed", str(seed),
                            "--quiet", "--force", "--out", str(out)], check=True, stderr=subprocess.DEVNULL)
        channels = OpenEXR.File(str(out / "image.exr")).channels()
        if "RGB" in channels:
            return np.asarray(channels["RGB"].pixels, dtype=np.float64)[..., :3]
        return np.stack([np.asarray(channels[c].pixels, dtype=np.float64) for c in "RGB"], axis=-1)

    print("| a camera that moves, 24 fps | spp | package | here | the same view standing still: package, here |\n"
          "|---|---|---|---|---|", flush=True)
    for scene, move in (("blocks", "around"), ("hall", "along")):
        pattern = write_frames(folder / "scenes", scene, move, count)
        truth = [rendered(pattern, frame, 1000 + frame, converged) for frame in range(1, count + 1)]
        exposure = 0.18 / math.exp(np.mean([np.mean(np.log(one @ weights + 1e-6)) for one in truth]))
        beside = [shown(one, exposure) for one in truth]
        middle = count // 2
        for spp in levels:
            moved = [shown(rendered(pattern, frame, frame, spp), exposure) for frame in range(1, count + 1)]
            # The frame in the middle, with new noise in each
            stood = [shown(rendered(pattern, middle, 100 + i, spp), exposure) for i in range(count)]
            alike = [beside[middle - 1]] * count
            step = count // JUDGED
            cells = [film(moved, beside, rate), here(moved[::step], beside[::step], f"{DISPLAY},fps=24"),
                     film(stood, alike, rate), here(stood[::step], alike[::step], f"{DISPLAY},fps=24")]
            package, found, standing, found_standing = cells
            print(f"| {scene}, {move} | {spp} | {package:.2f} | {found:.2f} | {standing:.2f}, {found_standing:.2f} |",
                  flush=True)
    sys.exit()

if task == "stop":
    edge, tile, spp, count = 128, 64, 144, 30
    corners = [(y, x) for y in range(0, edge, tile) for x in range(0, edge, tile)]
    crops = lambda pictures: [np.ascontiguousarray(np.asarray(pictures)[..., y : y + tile, x : x + tile, :]) for y, x in corners]
    print("| scene | samples of the still | lost | " + " | ".join(f"{rate} fps: samples, lost" for rate in RATES) + " |")
    print("|---|---|---|" + "---|" * len(RATES))
    for scene in ("cornell-box", "arcade", "bulb", "softbox", "glass-spheres"):
        outs = [folder / f"stop-{scene}-{seed}" for seed in range(1, count + 1)]
        for seed, out in enumerate(outs, 1):
            if not (out / "image.exr").exists():
                subprocess.run([program, "render", scene, "--size", f"{edge}x{edge}", "--criterion", f"spp:{spp}", "--max-spp",
                                str(spp), "--autosave", "0", "--seed", str(seed), "--quiet", "--force", "--out", str(out)],
                               check=True)
        renders = [linear(out) for out in outs]
        truth = np.mean(renders, axis=0)
        noise = (np.stack(renders) - truth) * math.sqrt(count / (count - 1))
        exposure = 0.18 / math.exp(np.mean(np.log(truth @ weights + 1e-6)))

        def needs(viewing):
            """Samples at which tiles stop: by pairs of renders as two halves, without the waits of small pictures."""
            found = []
            for a, b in zip(outs[:8:2], outs[1:8:2]):
                judge = [program, "judge", str(a / "image.exr"), "--against", str(b / "image.exr"), "--independent", "--spp",
                         str(spp), "--spp", str(spp), "--tile", str(tile), "--viewing", viewing, "--eyes", "none", "--json"]
                tiles = json.loads(subprocess.run(judge, check=True, capture_output=True, text=True).stdout)["tiles"]
                found.append([math.sqrt(t["threshold"]["low"] * t["threshold"]["high"]) for t in tiles])
            return TO_95 * np.exp(np.mean(np.log(found), axis=0))

        def at(samples):
            """Frames with as much noise as tiles have after these samples: noise of renders, scaled."""
            of_pixel = np.kron(np.asarray(samples).reshape(edge // tile, -1), np.ones((tile, tile)))[..., None]
            return [shown(truth + one * np.sqrt(spp / of_pixel), exposure) for one in noise]

        reference = crops(shown(truth, exposure))
        stop = needs(DISPLAY)
        lost = np.mean([[still(*pair) for pair in zip(crops(frame), reference)] for frame in at(stop)[:8]], axis=0)
        cells = []
        for rate in RATES:
            sooner = needs(f"{DISPLAY},fps={rate}")
            frames = crops(at(sooner))
            of_film = [film(of, [same] * count, float(rate)) for of, same in zip(frames, reference)]
            cells.append(f"×{np.mean(sooner / stop):.2f}, ×{np.mean(of_film) / np.mean(lost):.2f}")
        print(f"| {scene} | {stop.min():.0f} to {stop.max():.0f} | {lost.mean():.2f} | {' | '.join(cells)} |", flush=True)
    sys.exit()

if task == "denoised":
    import mitsuba_oidn as oidn

    device = oidn.Device(oidn.DeviceType.CPU)
    device.num_threads = 1
    device.commit()
    filter = device.new_filter("RT")
    filter.hdr, filter.quality = True, oidn.Quality.High

    def denoise(picture):
        """Of radiance alone."""
        made = np.empty((EDGE, EDGE, 3), np.float32)
        filter.set_image("color", np.maximum(picture, 0).astype(np.float32))
        filter.set_image("output", made)
        filter.execute()
        return made

    def write(path, picture):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(picture, np.float32)}).write(str(path))

    def estimate(halves, cleaned, exposure, spp, viewing):
        """JODs lost by the mean of two denoised halves, from the halves alone: by the command."""
        with tempfile.TemporaryDirectory() as scratch:
            paths = [str(pathlib.Path(scratch) / f"{name}.exr") for name in ("a", "b", "da", "db")]
            for path, picture in zip(paths, (*halves, *cleaned)):
                write(path, picture)
            a, b, da, db = paths
            judge = [program, "judge", a, "--spp", str(spp), "--against", b, "--spp", str(spp), "--independent"]
            options = ["--denoised", da, db, "--tile", str(EDGE), "--exposure", str(exposure), "--viewing", viewing, "--json"]
            said = subprocess.run(judge + options, check=True, capture_output=True, text=True).stdout
            return json.loads(said)["tiles"][0]["jods_lost"]

    print("| denoised | spp | still: package, here | 24 fps: package, here |\n|---|---|---|---|")
    for scene in SCENES:
        pictures, reference, exposure = truth_of(scene)
        for spp, of in pictures.items():
            pairs = [(of[2 * i], of[2 * i + 1]) for i in range(FRAMES // 2)]
            cleaned = [tuple(map(denoise, pair)) for pair in pairs]
            frames = [shown((a + b) / 2, exposure) for a, b in cleaned]
            alone = np.mean([still(one, reference) for one in frames[::3]])
            together = film(frames, [reference] * len(frames), 24.0)
            found = [np.mean([estimate(pair, made, exposure, spp, f"{DISPLAY}{rate}") for pair, made in
                              list(zip(pairs, cleaned))[::3]]) for rate in ("", ",fps=24")]
            print(f"| {scene} | {2 * spp} | {alone:.2f}, {found[0]:.2f} | {together:.2f}, {found[1]:.2f} |", flush=True)
    sys.exit()

rows, moving = [], []
for scene in SCENES:
    pictures, reference, exposure = truth_of(scene)
    for spp, of in pictures.items():
        frames = [shown(picture, exposure) for picture in of]
        few = frames[:: FRAMES // JUDGED]
        row = dict(scene=scene, spp=spp, still=np.mean([still(one, reference) for one in few]),
                   same=film([frames[0]] * 8, [reference] * 8, 24.0))
        for rate in RATES:
            row[f"package {rate}"] = film(frames, [reference] * FRAMES, float(rate))
            row[f"here {rate}"] = here(few, [reference] * len(few), f"{DISPLAY},fps={rate}")
            row[f"contrast {rate}"] = contrast_of(few[0], reference, row[f"package {rate}"])
        rows.append((row, few[0], reference))
        print(json.dumps({k: v if isinstance(v, str) else round(float(v), 4) for k, v in row.items()}), file=sys.stderr,
              flush=True)
        # A camera that turns: a window that moves over the picture by two pixels a frame, a degree and a quarter a second
        if scene in ("cornell-box", "arcade") and spp == 48:
            part = EDGE - 2 * FRAMES
            window = lambda picture, i: np.ascontiguousarray(picture[: part, 2 * i : 2 * i + part])
            moved = [window(one, i) for i, one in enumerate(frames)]
            beside = [window(reference, i) for i in range(FRAMES)]
            step = FRAMES // JUDGED
            moving.append((scene, film(moved, beside, 24.0), here(moved[::step], beside[::step], f"{DISPLAY},fps=24"),
                           film([window(one, 0) for one in frames], [beside[0]] * FRAMES, 24.0)))

print("| scene | spp | still | " + " | ".join(f"{rate} fps: package, here" for rate in RATES) + " | one seed, 24 fps |")
print("|---|---|---|" + "---|" * (len(RATES) + 1))
for row, _, _ in rows:
    cells = [f"{row[f'package {rate}']:.2f}, {row[f'here {rate}']:.2f}" for rate in RATES]
    print(f"| {row['scene']} | {row['spp']} | {row['still']:.2f} | " + " | ".join(cells) + f" | {row['same']:.2f} |")
print("\n| fps | off by at most, on average (JOD) | samples that a film needs, of a still's: least, mean, most |"
      " a factor instead: off by at most, on average |")
print("|---|---|---|---|")
for rate in RATES:
    off = np.array([abs(row[f"package {rate}"] - row[f"here {rate}"]) for row, _, _ in rows])
    factors = np.array([row[f"contrast {rate}"] ** 2 for row, _, _ in rows])
    factor = math.exp(np.mean(np.log(factors)))
    by_factor = np.array([abs(still(weaker(test, reference, math.sqrt(factor)), reference) - row[f"package {rate}"])
                          for row, test, reference in rows])
    print(f"| {rate} | {off.max():.3f}, {off.mean():.3f} | ×{factors.min():.2f}, ×{factor:.2f}, ×{factors.max():.2f} | "
          f"{by_factor.max():.3f}, {by_factor.mean():.3f} |")
print("\n| a camera that turns, 24 fps | package | here | package, standing still |\n|---|---|---|---|")
for scene, package, found, standing in moving:
    print(f"| {scene}, 48 spp | {package:.2f} | {found:.2f} | {standing:.2f} |")
