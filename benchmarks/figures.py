#!/usr/bin/env python3
"""Prints the figures that take few lines to measure: figures.py NAME, a function below. benchmarks/all runs it; $NOISEFLOOR is the
program, target/debug/noisefloor by default. Needs nothing but the standard library, unless a function says so."""

import csv
import functools
import json
import math
import os
import pathlib
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
NOISEFLOOR = os.environ.get("NOISEFLOOR", str(ROOT / "target/debug/noisefloor"))
HUMAN = pathlib.Path(os.environ.get("NOISEFLOOR_SHARED", ROOT / "../shared")) / "human"
ABLATIONS = {"the tile's noise, its picture's noise and light": "", "without light": "picture_light",
             "only the tile's noise": "picture_noise,picture_light"}
# Between verdicts, and before the first
STEPS = {"none": (1, 0), "fine, from 50": (10, 50), "fine, from 100": (10, 100), "every 20": (20, 20), "every 100": (100, 100)}


def run(*words, **more):
    """Standard output of a command, which must succeed."""
    return subprocess.run([str(w) for w in words], cwd=ROOT, check=True, text=True, stdout=subprocess.PIPE, **more).stdout


def table(name, head, rows):
    print(f"### {name}\n| " + " | ".join(["", *head]) + " |\n" + "|---" * (len(head) + 1) + "|")
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)
    print()


def factor(number):
    return f"×{number:.2f}"


def share(number, digits=0):
    return f"{100 * number:.{digits}f} %"


@functools.cache
def evaluate(*options, table="fixtures/human-table.csv"):
    """The report of `noisefloor-lab evaluate`, and its zones."""
    with tempfile.TemporaryDirectory() as folder:
        report, zones = f"{folder}/scores.json", f"{folder}/zones.csv"
        given = ["--table", table] if table else []
        run(NOISEFLOOR + "-lab", "evaluate", *given, *options, "--json", report, "--csv", zones)
        with open(report) as scores, open(zones) as lines:
            return json.load(scores), list(csv.DictReader(lines))


def people():
    """The model against people, scenes left out; `nested`: with everything chosen without the scene that is scored."""
    (nested, zones), (unseen, left_out) = evaluate("--nested", table="fixtures/human-choices.csv"), evaluate("--leave-one-scene-out")
    learned, inspect = evaluate()[1], json.loads(run(NOISEFLOOR, "inspect", "--json"))
    worst = lambda scores: max(scores["scenes"], key=lambda scene: scene["error_factor"])
    scores = lambda s: [factor(s["error_factor"]), factor(s["bias_factor"]), share(s["early_share"])]
    pictures = lambda s: share(s["image_accuracy"], 1)
    baselines = nested["baselines"]
    table("readme", ["error", "bias", "early", "pictures right"],
          [[name, *scores(s), pictures(s)] for name, s in [
              ("noisefloor", nested), ("one noise level for all scenes", baselines["constant"]),
              ("median of the *same* scene's other zones", baselines["scene_median"])]])
    table("scenes", ["error", "bias", "early", "pictures right", "one noise level: error, early", "the scene's own median: error"],
          [[s["scene"], *scores(s), pictures(s), f"{factor(s['baselines']['constant']['error_factor'])}, "
            f"{share(s['baselines']['constant']['early_share'])}", factor(s["baselines"]["scene_median"]["error_factor"])]
           for s in [*nested["scenes"], {**nested, "scene": "**all**"}]])
    ablated = {name: evaluate("--leave-one-scene-out", *(["--without", names] if names else []))[0] for name, names in ABLATIONS.items()}
    table("ablation", ["error", "bias", "early", "worst scene", "calibration error"],
          [[name, *scores(s), factor(worst(s)["error_factor"]), f"{s['calibration_error']:.3f}"] for name, s in ablated.items()])
    mean = lambda rows, column, scene: f"{statistics.mean(float(z[column]) for z in rows if scene in ('mean', z['scene'])):,.0f}"
    table("thresholds", ["people", "model, learned", "model, unseen"],
          [[scene, mean(learned, "human_spp", scene), mean(learned, "predicted_spp", scene), mean(left_out, "predicted_spp", scene)]
           for scene in [*dict.fromkeys(z["scene"] for z in learned), "mean"]])
    lisic = [abs(math.log(float(z["predicted_spp"]) / float(z["human_spp"]))) for z in zones if "-view" not in z["scene"]]
    spread = inspect["spread"]
    # Thresholds are normal in ln(spp), and their mean exp(s^2/2) of the median's
    to95 = lambda s: factor(math.exp(statistics.NormalDist().inv_cdf(0.95) * math.hypot(spread["scenes"], s) - s**2 / 2))
    for name, value in {
        "nested.error": factor(nested["error_factor"]), "nested.low": factor(nested["error_interval"][0]),
        "nested.high": factor(nested["error_interval"][1]), "nested.calibration": f"{nested['calibration_error']:.3f}",
        "nested.below": share(statistics.mean(float(z["stop_spp"]) < float(z["human_spp"]) for z in zones)),
        "nested.lisic": factor(math.exp(statistics.mean(lisic))),
        "worst.error": factor(worst(nested)["error_factor"]), "unseen.unfamiliar": str(unseen["unfamiliar_zones"]),
        "table.zones": str(unseen["zones"]), "table.scenes": str(len(unseen["scenes"])), "table.real": f"{unseen['levels_real']:,}",
        "table.synthesised": f"{unseen['levels_synthesised']:,}", "inspect.familiar": f"{inspect['familiar_reach']:.2f}",
        "inspect.error": factor(inspect["record"]["leave_one_scene_out"]["error_factor"]),
        "inspect.scenes": f"{spread['scenes']:.2f}", "inspect.people": f"{spread['people']}", "inspect.to95": to95(spread["people"]),
        "inspect.to95low": to95(0.4), "inspect.to95high": to95(0.7),
    }.items():
        print(f"{name}: {value}")


def steps():
    """What steps between verdicts add to the error: a tile stops at the first verdict at or after its threshold."""
    zones = [(float(z["human_spp"]), float(z["predicted_spp"])) for z in evaluate("--leave-one-scene-out")[1] if z["censored"] == "false"]
    rows = []
    for name, (step, first) in STEPS.items():
        stops = [max(first, math.ceil(spp / step - 1e-9) * step) if step > 1 else spp for _, spp in zones]
        ratios = [math.log(stop / human) for stop, (human, _) in zip(stops, zones)]
        rows.append([name, f"{statistics.mean(stops):.0f}", factor(math.exp(statistics.mean(map(abs, ratios)))),
                     factor(math.exp(statistics.mean(ratios))), share(statistics.mean(r < math.log(0.5) for r in ratios), 1)])
    table("steps", ["mean spp", "error", "bias", "below half"], rows)


def rivals():
    """Other criteria on the pictures that people judged, each with the constant that agrees with people over the other scenes."""
    names = {"dammertz": "Dammertz et al. 2010", "cycles": "Cycles, adaptive sampling", "vdp-first": "Takouachet et al. 2007",
             "luxcore": "LuxCore, halt condition", "vdp-stages": "Myszkowski 1998", "relative-error": "Mitsuba 0.6, relative error",
             "cvvdp": "*ColorVideoVDP, with the converged picture*"}
    corpora = [word for name in ("lisic9", "lisic-two") for word in ("--corpus", HUMAN / name)]
    report = evaluate(*map(str, corpora), "--leave-one-scene-out", "--rivals", ",".join(names), table=None)[0]
    found = {rival["name"]: rival for rival in report["rivals"]}
    table("rivals", ["constant, all scenes", "error", "bias", "early"],
          [[title, f"{found[name]['constant']:.2g}", factor(found[name]["scores"]["error_factor"]),
            factor(found[name]["scores"]["bias_factor"]), share(found[name]["scores"]["early_share"])] for name, title in names.items()])


def judged():
    """Of each scene that people judged: its name, the last picture and an earlier one with at most a third of its samples, each as
    floats from 0 to 1 and its samples, and its zones. Needs numpy and pillow."""
    import numpy as np
    from PIL import Image
    read = lambda path: np.asarray(Image.open(path).convert("RGB"), dtype=float) / 255
    for folder in ("lisic9", "lisic-two"):
        rows = list(csv.DictReader(open(HUMAN / folder / "thresholds.csv")))
        for scene in sorted({r["scene"] for r in rows}):
            pictures = {int(path.stem): path for path in (HUMAN / folder / scene).glob("*.png")}
            many = max(pictures)
            n = max(spp for spp in pictures if spp <= many / 3)
            yield scene, read(pictures[many]), many, read(pictures[n]), n, [r for r in rows if r["scene"] == scene]


def same_numbers():
    """Plain measures of noise from the PNGs, by themselves and with noisefloor's two numbers of the picture; no code of the project.
    Needs numpy and pillow."""
    import numpy as np
    weights = np.array([0.2126, 0.7152, 0.0722])
    linear = lambda a: np.where(a <= 0.04045, a / 12.92, ((a + 0.055) / 1.055) ** 2.4)
    measures = {
        "squared error of displayed luminance": lambda a, b: ((a - b) @ weights) ** 2,
        "relative squared error of luminance": lambda a, b: ((linear(a) - linear(b)) @ weights) ** 2 / ((linear(b) @ weights) ** 2 + 0.01),
        "relative squared error of red, green and blue": lambda a, b: ((linear(a) - linear(b)) ** 2 / (linear(b) ** 2 + 0.01)).mean(-1),
    }
    zones = []
    for scene, last, many, picture, n, of_scene in judged():
        fields = {name: of(picture, last) / (1 / n - 1 / many) for name, of in measures.items()}
        light = math.log(linear(last @ weights).mean() + 0.002)
        for r in of_scene:
            x, y, w, h = (int(r[k]) for k in ("x", "y", "width", "height"))
            human = min(float(r["human_spp"]), 0.999 * many)
            zones.append({"scene": scene, "group": scene[:3], "human": float(r["human_spp"]), "many": many, "light": light,
                          # The last picture contains the samples of the earlier ones
                          "goal": -math.log(1 / human - 1 / many), "range": (float(r["first_spp"]), float(r["last_spp"])),
                          **{name: math.log(field[y:y + h, x:x + w].mean()) for name, field in fields.items()}})
    rows = []
    for name in measures:
        cells = []
        for with_picture in (False, True):
            noise = np.array([z[name] for z in zones])
            around = np.array([np.quantile([o[name] for o in zones if o["scene"] == z["scene"]], 7 / 8) for z in zones])
            x = np.c_[around - noise, [z["light"] for z in zones]] if with_picture else np.zeros((len(zones), 0))
            rest, predicted = np.array([z["goal"] for z in zones]) - noise, np.zeros(len(zones))
            for group in {z["group"] for z in zones}:
                out = np.array([z["group"] == group for z in zones])
                mean, centred = x[~out].mean(0), x[~out] - x[~out].mean(0)
                level = rest[~out].mean()
                slope = np.linalg.solve(centred.T @ centred + np.eye(x.shape[1]), centred.T @ (rest[~out] - level))
                predicted[out] = noise[out] + level + (x[out] - mean) @ slope
            ratio = np.log([np.clip(1 / (math.exp(-p) + 1 / z["many"]), *z["range"]) / z["human"] for p, z in zip(predicted, zones)])
            by_scene = [np.abs(ratio[[z["scene"] == scene for z in zones]]).mean() for scene in {z["scene"] for z in zones}]
            cells.append(f"{factor(math.exp(np.abs(ratio).mean()))}, {share(np.mean(ratio < math.log(0.5)))}, {factor(math.exp(max(by_scene)))}")
        rows.append([name, *cells])
    table("same-numbers", ["one constant: error, early, worst scene", "with the picture's noise and light"], rows)


def reproduce():
    """The paper's experiment: shares of pairs classified right, by what is learned and what is asked. 5 GB of memory."""
    corpora = [HUMAN / "lisic9", HUMAN / "sin3d-rerendered/staircase2-view0"]
    rows, kinds = [], ("noisy", "identical")
    with tempfile.TemporaryDirectory() as out:
        run(NOISEFLOOR + "-lab", "reproduce", "--corpus", *corpora, "--out", out)
        for path in sorted(pathlib.Path(out).glob("*-pair-*.json")):
            machines = json.loads(path.read_text())["machines"]
            right = lambda of, kinds: share(sum(m[of][f"{k}_right"] for m in machines for k in kinds)
                                            / sum(m[of][k] for m in machines for k in kinds), 2)
            rows.append([path.stem, right("synthesised", kinds), *(right("synthesised", [k]) for k in kinds), right("real", kinds)])
    table("reproduce", ["right", "noisy right", "identical right", "real, right"], rows)


def mitsuba():
    """Processor seconds of our path tracer and of Mitsuba's `scalar_rgb` for 16 samples a pixel of 320x180, one thread, without loading;
    the less of three rounds in turn. Needs mitsuba, and the scenes beside the human data."""
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    used = lambda: resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    rows = []
    for name in ("cornell-box", "modern-hall", "living-room"):
        path = ROOT / "fixtures/cornell-box.xml" if name == "cornell-box" else HUMAN.parent / "scenes" / name / "scene.xml"
        scene = mi.load_file(str(path))
        sensor = mi.traverse(scene.sensors()[0])
        sensor["film.size"] = (320, 180)
        sensor.update()
        ours, theirs = [], []
        for seed in range(3):
            taken = []
            for spp in (8, 24):
                before = used()
                rendered(path, "--size", "320x180", "--criterion", f"spp:{spp}", "--threads", "1", "--seed", seed)
                taken.append(used() - before)
            begun = time.process_time()
            mi.render(scene, spp=16, seed=seed, integrator=mi.load_dict({"type": "path", "max_depth": 65}))
            ours, theirs = [*ours, taken[1] - taken[0]], [*theirs, time.process_time() - begun]
        rows.append([name, f"{min(ours):.2f} s", f"{min(theirs):.2f} s", factor(min(theirs) / min(ours))])
    table("mitsuba", ["noisefloor", "`scalar_rgb`", "faster"], rows)


def rendered(scene, *options):
    """Report of a render, and mean samples per pixel."""
    with tempfile.TemporaryDirectory() as out:
        run(NOISEFLOOR, "render", scene, *options, "--quiet", "--force", "--out", out)
        return json.loads(pathlib.Path(out, "report.json").read_text()), list(csv.DictReader(open(f"{out}/stops.csv")))


def first_picture():
    """What the Cornell box has lost where it stops, against 8,192 samples of another seed. Needs what look.py needs."""
    import look
    rows = []
    with tempfile.TemporaryDirectory() as out:
        size = ["--size", "384x384", "--tile", "64", "--quiet", "--force", "--out"]
        run(NOISEFLOOR, "render", "cornell-box", *size, f"{out}/stopped")
        run(NOISEFLOOR, "render", "cornell-box", "--criterion", "spp:8192", "--seed", "1098", *size, f"{out}/reference")
        for name, scaled in (("scaled", True), ("as it is", False)):
            rows.append([name, *(f"{number:.2f}" for number in look.picture(out, scaled))])
    table("first-picture", ["JOD lost by the worst window of 64 pixels", "contrast in the worst window of 28"], rows)


def people_lost():
    """What zones had lost where people stopped. Needs what look.py needs."""
    import look
    rows, of_scenes = [], []
    between = lambda values: f"({min(values):.2f} to {max(values):.2f})"
    for scene, contrasts, crops, zones in look.people(judged()):
        means = statistics.geometric_mean(contrasts), statistics.mean(crops), statistics.mean(zones)
        rows.append([scene, f"{means[0]:.2f} {between(contrasts)}", f"{means[1]:.2f} {between(crops)}", f"{means[2]:.2f}"])
        of_scenes.append(means)
    contrasts, *jods = zip(*of_scenes)
    means = statistics.geometric_mean(contrasts), *map(statistics.mean, jods)
    rows.append(["mean (of contrast, geometric)", *(f"{mean:.2f}" for mean in means)])
    table("people-lost", ["contrast, worst window of a zone", "JOD lost by its worst 64×64", "by the zone"], rows)


def films():
    """Samples until all tiles have converged, of a still and of frames."""
    rows = []
    for scene in ("cornell-box", "arcade", "bulb", "courtyard"):
        spp = [statistics.mean(float(t["spp"]) for t in rendered(scene, "--size", "192x192", "--tile", "64", "--viewing", viewing)[1])
               for viewing in ("desk", "desk,fps=24", "desk,fps=60")]
        rows.append([scene, *(f"{n:.0f}" + (f" (×{n / spp[0]:.2f})" if i else "") for i, n in enumerate(spp))])
    table("films", ["still", "24 fps", "60 fps"], rows)


BLACK = """<scene version="3.0.0"><integrator type="path"/>
<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world"><lookat origin="0,-4,1" target="0,0,0" up="0,0,1"/></transform></sensor>
<shape type="sphere"><float name="radius" value="0.8"/><bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.5,0.3,0.1"/></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale x="1.5" y="1.5"/><rotate x="1" angle="150"/><translate x="-2" y="-2" z="3"/></transform>
<emitter type="area"><rgb name="radiance" value="8,8,8"/></emitter></shape></scene>"""


# How many of the sizes each is looked at in
GUARDED = {"courtyard": 3, "lanterns": 3, "ball on black": 3, "plates": 2, "arcade": 2, "lamp on black": 2, "cornell-box": 2, "softbox": 2,
           "lamp in view": 2, "grazing": 1, "bulb": 1, "lamp in glass": 1, "modern-hall": 1, "metal on black": 1, "softbox, a dot": 1,
           "courtyard, a dot": 1, "lanterns, a dot": 1, "door-ajar": 1, "glass-spheres": 1, "keyhole": 1, "caustic": 1}


def guards():
    """Samples of the oracle and of its eyes alone, of tiles that end with both, and which tiles noise decides; and seeds that end before
    what they take has begun to show. Needs `cargo build -p noisefloor-scenefile --example eyes_alone`."""
    plastic = 'plastic"><rgb name="diffuse_reflectance" value="0.5,0.3,0.1"/>'
    room = ROOM.replace("LAMP", "20,20,20")
    own = {"ball on black": BLACK, "metal on black": BLACK.replace(plastic, 'roughconductor"><float name="alpha" value="0.1"/>'),
           "lamp on black": BLACK.replace('x="-2" y="-2" z="3"', 'x="-0.6" y="2" z="0.8"'),
           "lamp in glass": room, "lamp in view": room.replace('value="0.25"', 'value="0.02"')}
    rows, sizes = [], {"128×128": 32, "256×256": 64, "480×270": 64}
    with tempfile.TemporaryDirectory() as folder:
        files = {"modern-hall": HUMAN.parent / "scenes/modern-hall/scene.xml"}
        for name, text in own.items():
            files[name] = pathlib.Path(folder, f"{name}.xml")
            files[name].write_text(text)
        for scene, count in GUARDED.items():
            name, *dot = scene.removesuffix(" a dot").split(",")
            found = [alone(files.get(name, name), size, tile, 1, 1000, *["dot"] * len(dot)) for size, tile in [*sizes.items()][:count]]
            rows.append([scene, *map(guard_cell, found), *[""] * (len(sizes) - count)])
    table("guards", sizes, rows)
    rows = []
    for scene, early in (("caustic", 125), ("keyhole", 125), ("plates", 50)):
        found = [alone(scene, "96x96", 32, seed, early) for seed in range(1, 21)]
        rows.append([scene, *(f"{sum(int(f[by]) > int(f['tiles']) / 4 for f in found)} of 20" for by in ("oracle-done", "eyes-done"))])
    table("guards-luck", ["seeds that end early", "by eyes alone"], rows)


def alone(scene, size, *words):
    said = run(pathlib.Path(NOISEFLOOR).parent / "examples/eyes_alone", scene, size.replace("×", "x"), *words)
    return dict(line.split(" ", 1) for line in said.splitlines())


def guard_cell(found):
    kind = "-both" if int(found["both"]) else ""
    taken, eyes = float(found["oracle" + kind]), float(found["eyes" + kind])
    by_noise = share(int(found.get("noise", 0)) / int(found["tiles"]))
    return f"{taken:.0f}, {eyes:.0f}" + (f", {factor(taken / eyes)}" if kind else ", none") + f"; {by_noise}"


def on_black():
    """Samples of a ball on black, and with the exposure given that was found: $NOISEFLOOR_OIDN_PYTHON has Open Image Denoise."""
    rows = []
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as black:
        black.write(BLACK)
        black.flush()
        for name, *options in (("240×135",), ("240×135, denoised", "--denoise", "oidn"), ("960×540",), ("1920×1080",)):
            words = ["--size", name.partition(",")[0].replace("×", "x"), "--tile", "32", "--seed", "1", *options]
            found = rendered(black.name, *words)[0]
            given = rendered(black.name, *words, "--exposure", found["exposure"])[0]
            taken, known = (report["samples"] / (report["width"] * report["height"]) for report in (found, given))
            rows.append([name, f"{taken:.0f} ({factor(taken / known)})", f"{known:.0f}"])
    table("on-black", ["samples", "with its exposure given"], rows)


ROOM = """<scene version="3.0.0"><integrator type="path"/>
<sensor type="perspective"><float name="fov" value="45"/><transform name="to_world"><lookat origin="0,1,3.4" target="0,1,0" up="0,1,0"/></transform></sensor>
<shape type="rectangle"><transform name="to_world"><scale x="3" y="3"/><rotate x="1" angle="-90"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><scale x="3" y="3"/><translate z="-1"/></transform></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="3" z="0.5"/></transform>
<emitter type="area"><rgb name="radiance" value="3,3,3"/></emitter></shape>
<shape type="sphere"><point name="center" x="0.4" y="0.8" z="0"/><float name="radius" value="0.25"/><bsdf type="dielectric"/></shape>
<shape type="sphere"><point name="center" x="0.4" y="0.8" z="0"/><float name="radius" value="0.03"/>
<emitter type="area"><rgb name="radiance" value="LAMP"/></emitter></shape></scene>"""


def coloured():
    """What a room has lost where it stops, by the colour of a small lamp in glass, against 6,000 samples of another seed. Needs what
    look.py needs; $NOISEFLOOR_OIDN_PYTHON has Open Image Denoise."""
    import look
    rows, lamps = [], {"white": "20,20,20", "red": "60,0,0", "green": "0,30,0", "blue": "0,0,200", "magenta": "60,0,200"}
    for name in (*lamps, "blue, denoised"):
        with tempfile.TemporaryDirectory() as out:
            pathlib.Path(out, "room.xml").write_text(ROOM.replace("LAMP", lamps[name.partition(",")[0]]))
            words = [NOISEFLOOR, "render", f"{out}/room.xml", "--size", "96x96", "--tile", "32", "--quiet", "--out"]
            run(*words, f"{out}/stopped", "--seed", "3", *(["--denoise", "oidn"] if "," in name else []))
            run(*words, f"{out}/reference", "--criterion", "spp:6000", "--seed", "99")
            report = json.loads(pathlib.Path(out, "stopped/report.json").read_text())
            lost, _ = look.picture(out, scaled="," not in name)
            rows.append([name, f"{report['samples'] / (report['width'] * report['height']):.0f}", f"{lost:.2f}"])
    table("coloured", ["samples", "JOD lost by the worst window of 64 pixels"], rows)


# Runs the host of the denoiser, and writes how many pictures each call had, and the processor time before and after
TIMED = """#!{python} -u
import os, runpy, sys, time
sys.argv = sys.argv[-1:]
sys.path.insert(0, os.path.dirname(sys.argv[0]))
import host
def serve(Host, real=host.serve):
    def timed(self, width, height, frames, real=Host.filter):
        before, made = time.process_time(), real(self, width, height, frames)
        print(len(frames), before, time.process_time(), file=open({log!r}, "a"))
        return made
    Host.filter = timed
    real(Host)
host.serve = serve
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def denoised_seconds():
    """Where the processor time of `render --denoise` goes; $NOISEFLOOR_OIDN_PYTHON has mitsuba-oidn."""
    used = lambda: (lambda now: now.ru_utime + now.ru_stime)(resource.getrusage(resource.RUSAGE_CHILDREN))
    rows = []
    for scene, size in (("cornell-box", "480x270"), ("arcade", "480x270"), ("cornell-box", "256x256"), ("arcade", "256x256")):
        with tempfile.TemporaryDirectory() as folder:
            timed, log = pathlib.Path(folder, "python"), f"{folder}/calls"
            timed.write_text(TIMED.format(python=os.environ["NOISEFLOOR_OIDN_PYTHON"], log=log))
            timed.chmod(0o755)
            before = used()
            run(NOISEFLOOR, "render", scene, "--denoise", "oidn", "--size", size, "--seed", 5, "--out", f"{folder}/out",
                env={**os.environ, "NOISEFLOOR_OIDN_PYTHON": str(timed)}, stderr=subprocess.DEVNULL)
            everything = used() - before
            calls = [[float(word) for word in line.split()] for line in open(log)]
            report = json.loads(pathlib.Path(folder, "out/report.json").read_text())
        width, height = map(int, size.split("x"))
        verdicts, finished = (sum(end - start for count, start, end in calls if count == n) for n in (2, 1))
        start = calls[-1][2] - verdicts - finished
        rows.append([f"{scene}, {size.replace('x', '×')}", f"{report['samples'] / width / height:.0f}", f"{sum(c[0] == 2 for c in calls)}",
                     *(f"{seconds:.1f}" for seconds in (everything - calls[-1][2], verdicts, finished, start, everything)),
                     factor(everything / (everything - verdicts))])
    table("denoised-seconds", ["samples", "verdicts", "rendering", "verdicts' denoisings", "finished picture", "the denoiser's start", "all",
                               "over all but verdicts"], rows)


def hard():
    """Scenes that are hard to denoise: benchmarks/hard.csv, by larger.py with SIZE = (128, 72) and 256 samples."""
    with open(ROOT / "benchmarks/hard.csv") as lines:
        kept = list(csv.DictReader(lines))
    def lost(scene, key, times=1.0):
        means = (statistics.mean(float(r[key]) for r in kept if (r["scene"], r["spp"]) == (scene, spp)) for spp in ("16", "64", "256"))
        return ", ".join(f"{times * mean:.1f}" for mean in means)
    # Verdicts count the mean of four mirror images as 0.97
    rows = [[scene, lost(scene, "estimate", 0.97), lost(scene, "true"), lost(scene, "true_denoised")] for scene in sorted({r["scene"] for r in kept})]
    table("hard", ["estimated", "lost", "against denoised references"], rows)


def others():
    """Scenes that no constant of larger.py was chosen on: benchmarks/others.csv, by it with SIZE = (192, 108) and 256 samples. Needs numpy."""
    import larger
    larger.SIZE, rows = (192, 108), []
    for scene, pictures in larger.read(ROOT / "benchmarks/others.csv").items():
        pooled, own = ([larger.ours(p, **how) for p in pictures] for how in ({}, {"powers": (1, 0, 0)}))
        lost = [value for o in pooled for value in o.lost("noisy")[o.let_go()]]
        samples, _, _, same = larger.compared(pictures, pooled, "noisy")
        rows.append([scene, f"{samples:.0f}", f"{larger.compared(pictures, own, 'noisy')[0]:.0f}",
                     f"{sum(value > larger.LIMIT for value in lost)} of {len(lost)}, of {sum(p.good.sum() for p in pictures)}",
                     ", ".join(factor(same[by][2]) for by in ("worst", "19 of 20", "mean")) if lost else "none"])
    table("others", ["samples", "each estimate by itself", "beyond 0.3 of those that stop, of those with a reference",
                     "uniform, by worst, 19 of 20, mean"], rows)


def audits():
    """What small renders of our own have lost, place by place; the share by Clopper and Pearson, as an audit has it, if all are kept."""
    lost = []
    for scene in ("cornell-box", "softbox", "courtyard", "arcade", "lanterns", "plates"):
        audit = rendered(scene, "--size", "128x128", "--seed", "1", "--audit", "8")[0]["audit"]
        lost += [place["jods_lost"] for place in audit["places"]]
    kept = sum(jods <= audit["limit"] for jods in lost)
    print(f"audits.kept: {kept} of {len(lost)}\naudits.worst: {max(lost):.2f}")
    if kept == len(lost):
        print(f"audits.share: {share(0.05 ** (1 / kept))}")


def large():
    """Time, memory and files of renders of a minute."""
    rows = []
    for size in ("512x512", "3840x2160", "7680x4320"):
        width, height = map(int, size.split("x"))
        with tempfile.TemporaryDirectory() as out:
            begun, limits = time.time(), ["--time", "60", "--max-spp", "1000000", "--people", "99.9%"]
            run(NOISEFLOOR, "render", "courtyard", "--size", size, *limits, "--quiet", "--force", "--out", out)
            report, wall = json.loads(pathlib.Path(out, "report.json").read_text()), time.time() - begun
            files = sum(f.stat().st_size for f in pathlib.Path(out).iterdir())
        # Of the largest child so far: sizes grow
        peak = 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / (width * height)
        rows.append([size, f"{wall:.1f} s", f"{report['seconds_source']:.1f} s", f"{peak:.1f} bytes", f"{files / (width * height):.0f} bytes"])
    table("large", ["took", "in the renderer", "peak memory, per pixel", "folder, per pixel"], rows)


def benches():
    """Medians of criterion's benchmarks of the core, in the order they are printed."""
    said = run("cargo", "bench", "--quiet", "-p", "noisefloor", "--bench", "oracle", stderr=subprocess.DEVNULL)
    rows = [[name.strip(), time] for name, time in re.findall(r"^(.+?)\s+time:\s+\[\S+ \S+ (\S+ \S+) ", said, re.MULTILINE)]
    table("benches", ["median"], rows)


def builds():
    """What a first build takes, and what the core takes that is the one dependency of an empty program."""
    def build(*words, cwd):
        with tempfile.TemporaryDirectory() as target:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(["cargo", "build", *words, "--target-dir", target], cwd=cwd, check=True, stderr=subprocess.DEVNULL)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return f"{after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime:.0f} s"
    rows = [["the command, `cargo build --release`", build("--release", cwd=ROOT)]]
    for label, features in (("the core, for an embedder", ""), ("without files", ', default-features = false, features = ["bundled-model"]')):
        with tempfile.TemporaryDirectory() as empty:
            run("cargo", "init", "--quiet", "--name", "empty", empty)
            with open(f"{empty}/Cargo.toml", "a") as manifest:
                manifest.write(f'noisefloor = {{ path = "{ROOT}/crates/noisefloor"{features} }}\n')
            rows.append([label, build(cwd=empty)])
    table("builds", ["processor time"], rows)


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in globals():
        sys.exit(__doc__)
    globals()[sys.argv[1]]()
