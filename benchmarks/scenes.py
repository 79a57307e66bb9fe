#!/usr/bin/env python3
"""Scene files of other people: how many load, and how far our pictures are from Mitsuba's.

    scenes.py survey FOLDER...         loads each scene file of each folder (a checked-out repository); prints the table
    scenes.py compare OUT FOLDER...    renders Mitsuba files by both renderers; adds lines to OUT/scenes.jsonl, and PNGs
    scenes.py table OUT                prints the table of what compare has found

Needs the examples `survey` and `halves` of noisefloor-scenefile (cargo build --release --example survey --example halves;
--bin says where they are). compare runs in an environment with Mitsuba 3 (noisefloor doctor --install mitsuba) and goes on
where it was stopped.

Both renderers take independent samples with a box filter and the path depth of the file. Twice as many pictures as
needed are rendered, from other seeds: the systematic difference is the mean of (a1 - b1)(a2 - b2)/(b + e)^2 over blocks of
8x8 pixels, whose expectation has no noise in it; its standard error is that over blocks. Variance is that of one sample,
of luminance, relative to (b + e)^2, in the median pixel block. e is 2 % of the median block.
"""

import argparse
import json
import os
import re
import struct
import subprocess
import sys
import time
import zlib
from collections import Counter, OrderedDict
from pathlib import Path

KINDS = {".xml": "Mitsuba", ".pbrt": "pbrt", ".gltf": "glTF", ".glb": "glTF"}


def findings(args, folder):
    """File, outcome and findings of each scene file in a folder."""
    run = subprocess.run([args.bin / "survey", folder], capture_output=True, text=True, check=True)
    rows = [line.split("\t") for line in run.stdout.splitlines() if "\t" in line]
    return [(row[0], row[2], row[3] if len(row) > 3 else "") for row in rows]


def commit(folder):
    """The commit of a checked-out repository, or what a file .commit says."""
    note = folder / ".commit"
    if note.exists():
        return note.read_text().strip()[:7]
    run = subprocess.run(["git", "-C", folder, "rev-parse", "--short=7", "HEAD"], capture_output=True, text=True)
    return run.stdout.strip() or "?"


def survey(args):
    print("| repository, commit | format | complete | load | of these without volumes | approximated or ignored |")
    print("|---|---|---|---|---|---|")
    reasons, totals = Counter(), OrderedDict()
    for folder in args.folders:
        counts = OrderedDict()
        for file, outcome, what in findings(args, folder):
            kind = KINDS[Path(file).suffix]
            count = counts.setdefault(kind, Counter())
            # Parts of other files, and files whose meshes or pictures are not there, say nothing about the loader
            if outcome == "refused" and re.search("no <sensor>|no WorldBegin|No such file", what):
                continue
            volumes = "medium" in what
            count.update(complete=1, load=int(outcome == "loaded"), clear=int(outcome == "loaded" and not volumes))
            count.update(noted=int(outcome == "loaded" and bool(what)))
            if outcome == "refused":
                reasons.update({f"{kind}: {reason}" for reason in what.split(" | ")})
        for kind, count in counts.items():
            if count["complete"]:
                name = folder.name.replace("+", "/")
                print(f"| {name} {commit(folder)} | {kind} | {count['complete']} | {count['load']} | {count['clear']} | {count['noted']} |")
                totals.setdefault(kind, Counter()).update(count)
    for kind, count in totals.items():
        share = count["load"] / count["complete"]
        print(f"| all | {kind} | {count['complete']} | {count['load']} ({share:.0%}) | {count['clear']} | {count['noted']} |")
    print()
    for reason, files in reasons.most_common():
        print(f"{files} {reason}")


def boxed(text):
    """Gives films without a filter a box: Mitsuba's own choice is a Gaussian, which smoothes noise and edges."""
    text = re.sub(r"<film\b([^>]*)/>", r"<film\1></film>", text)
    return re.sub(r"(<film\b[^>]*>)(?!(?:(?!</film>).)*<rfilter)", r'\1<rfilter type="box"/>', text, flags=re.S)


def prepared(args, file):
    """Mitsuba's scene of a file with independent samples and a box filter, the path depth that the file asks for, and the
    size of the picture."""
    import mitsuba as mi

    config = mi.parser.ParserConfig(args.variant)
    # As our reader takes them: unknown properties are ignored, and names are those of any version
    config.unused_properties = mi.LogLevel.Debug
    mi.file_resolver().prepend(str(file.parent))
    text = re.sub(r"<mode>.*?</mode>|<mode [^>]*/>", "", file.read_text(), flags=re.S).replace("<lookAt", "<lookat")
    text = boxed(text)
    given = dict(re.findall(r'<default name="([^"]*)" value="([^"]*)"', text))
    extra = {name: "16" for name in ("spp",) if "$" + name in text and name not in given}
    beside = file.with_name(f".{file.stem}-compared.xml")
    beside.write_text(text)
    try:
        state = mi.parser.parse_file(config, str(beside), **extra)
    finally:
        beside.unlink()
    mi.parser.transform_all(config, state)
    # Its own default where a file has none
    depth, size = 65, [8, 8]

    def become(node, plugin, keep=()):
        for name in list(node.props.keys()):
            if name not in keep and not name.startswith("_"):
                del node.props[name]
        node.props.set_plugin_name(plugin)

    for node in state.nodes:
        if node.type == mi.ObjectType.Integrator:
            given, kind = node.props.get("max_depth", -1), node.props.plugin_name()
            # These have none of their own: it is that of the integrator in them
            if kind not in ("aov", "moment", "stokes"):
                depth = 2 if kind == "direct" else given if given > 0 else 65
            become(node, "path")
        elif node.type == mi.ObjectType.Sampler:
            become(node, "independent")
        elif node.type == mi.ObjectType.ReconstructionFilter:
            become(node, "box")
        elif node.type == mi.ObjectType.Film:
            # Before there is a sensor: later it would keep the field of view that it has across, whatever the shape
            width, height = (int(node.props.get(name, 768 if name == "width" else 576)) for name in ("width", "height"))
            scale = args.edge / max(width, height)
            size = [max(8, round(width * scale / 8) * 8), max(8, round(height * scale / 8) * 8)]
            become(node, "hdrfilm", ("rfilter",))
            node.props["width"], node.props["height"] = size
            node.props["pixel_format"] = "rgb"
    scene = mi.parser.instantiate(config, state)
    return (scene[0] if isinstance(scene, list) else scene), depth, size


def ours(args, file, size, spp, root):
    """Two pictures of other seeds by the built-in renderer, and the seconds they took."""
    import mitsuba as mi
    import numpy as np

    out, start = args.out / "ours", time.time()
    env = dict(os.environ, SCENE_ROOT=str(root))
    command = [args.bin / "halves", file, "x".join(map(str, size)), str(spp), out]
    run = subprocess.run(command, env=env, capture_output=True, text=True, timeout=args.timeout)
    if run.returncode:
        raise RuntimeError("ours: " + run.stderr.strip()[-200:])
    seconds = time.time() - start
    read = lambda i: mi.Bitmap(f"{out}-{i}.exr").convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    return [np.array(read(i)) for i in (1, 2)], seconds


def theirs(args, file, spp):
    """The size of the picture, and a function that renders two of them by Mitsuba."""
    import mitsuba as mi
    import numpy as np

    scene, depth, size = prepared(args, file)
    sensor = scene.sensors()[0]
    integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 5})

    def render():
        start = time.time()
        both = [np.array(mi.render(scene, integrator=integrator, seed=s, spp=spp, sensor=sensor))[..., :3] for s in (11, 22)]
        return both, time.time() - start

    return size, render


def measured(a, b):
    """Numbers of two pictures a by us and two b by Mitsuba, and the blockwise difference."""
    import numpy as np

    def blocks(picture, n=8):
        grey = picture @ [0.2126, 0.7152, 0.0722] if picture.ndim == 3 else picture
        rows, columns = grey.shape[0] // n, grey.shape[1] // n
        return grey[: rows * n, : columns * n].reshape(rows, n, columns, n).mean((1, 3))

    a1, a2, b1, b2 = (blocks(p) for p in (*a, *b))
    truth = (b1 + b2) / 2
    lit = truth[truth > 0]
    floor = 0.02 * float(np.median(lit)) if lit.size else 1.0
    scale = (truth + floor) ** 2
    square = (a1 - b1) * (a2 - b2) / scale
    signed = ((a1 + a2) / 2 - truth) / (truth + floor)
    noise = np.sqrt(((a1 - a2) ** 2 + (b1 - b2) ** 2) / 4) / (truth + floor)
    grey = lambda p: p @ [0.2126, 0.7152, 0.0722]
    variance = lambda p: blocks((grey(p[0]) - grey(p[1])) ** 2) / scale
    ours, mitsubas = variance(a), variance(b)
    both = (ours > 0) & (mitsubas > 0)
    sums = zip((a[0] + a[1]).mean((0, 1)), (b[0] + b[1]).mean((0, 1)))
    mean = [float(ours / theirs) if theirs > 0 else 1.0 for ours, theirs in sums]
    return {
        "mean": mean,
        "square": float(square.mean()),
        "error": float(square.std() / square.size**0.5),
        "median": float(np.median(np.abs(signed))),
        "off": float(((np.abs(signed) > 0.1) & (np.abs(signed) > 4 * np.median(noise))).mean()),
        "variance": float(np.median(ours[both]) / np.median(mitsubas[both])) if both.any() else None,
        "variance_mean": float(ours.mean() / max(mitsubas.mean(), 1e-30)),
    }, signed


def png(path, picture):
    """Writes bytes of shape (height, width, 3)."""
    height, width, _ = picture.shape
    raw = b"".join(b"\0" + row.tobytes() for row in picture)
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def draw(path, a, b, signed):
    """Ours, Mitsuba's, and the difference: red where ours is brighter, blue where it is darker, full colour at 30 %."""
    import numpy as np

    a, b = (a[0] + a[1]) / 2, (b[0] + b[1]) / 2
    exposure = 0.5 / max(1e-9, float(np.percentile(b @ [0.2126, 0.7152, 0.0722], 75)))
    linear = lambda p: np.clip(p * exposure, 0, 1)
    encode = lambda x: np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    away = np.clip(signed / 0.3, -1, 1).repeat(8, 0).repeat(8, 1)
    difference = np.ones_like(a)
    difference[: away.shape[0], : away.shape[1]] = np.stack(
        [1 - np.clip(-away, 0, 1), 1 - np.abs(away), 1 - np.clip(away, 0, 1)], -1)
    sheet = np.hstack([encode(linear(a)), encode(linear(b)), difference])
    png(path, (sheet * 255 + 0.5).astype(np.uint8))


def compare(args):
    import mitsuba as mi

    mi.set_variant(args.variant)
    mi.set_log_level(mi.LogLevel.Error)
    args.out.mkdir(parents=True, exist_ok=True)
    results = args.out / "scenes.jsonl"
    done = {json.loads(line)["file"] for line in results.read_text().splitlines()} if results.exists() else set()
    for folder in args.folders:
        for file, outcome, what in findings(args, folder):
            if outcome != "loaded" or not file.endswith(".xml") or "medium" in what or file in done:
                continue
            if args.only and not re.search(args.only, file):
                continue
            found = {"file": file, "repository": folder.name, "findings": what, "spp": args.spp}
            try:
                size, render = theirs(args, Path(file), args.spp)
                a, found["seconds"] = ours(args, file, size, args.spp, folder)
                b, found["mitsuba_seconds"] = render()
                numbers, signed = measured(a, b)
                found.update(numbers, size=size)
                draw(args.out / (re.sub(r"[^A-Za-z0-9]+", "-", file).strip("-") + ".png"), a, b, signed)
            # Mitsuba itself may not read a file, or not render it in time: the table says so
            except (RuntimeError, ValueError, KeyError, IndexError, subprocess.TimeoutExpired) as error:
                found["failed"] = str(error)[-300:]
            with results.open("a") as lines:
                lines.write(json.dumps(found) + "\n")
            print(file, {k: v for k, v in found.items() if k not in ("file", "findings")}, flush=True)


def table(args):
    rows = [json.loads(line) for line in (args.out / "scenes.jsonl").read_text().splitlines()]
    done = [row for row in rows if "failed" not in row]
    print("| repository | compared | nothing approximated | of these within 3 standard errors | blocks off, median | variance, median |")
    print("|---|---|---|---|---|---|")
    by_source = OrderedDict()
    for row in sorted(done, key=lambda r: r["repository"]):
        by_source.setdefault(row["repository"], []).append(row)
    middle = lambda numbers: sorted(numbers)[len(numbers) // 2] if numbers else float("nan")
    for name, found in by_source.items():
        exact = [row for row in found if not re.search("replaced by (?!path)|fades|metal, gloss|is ignored: light|polarisation|the sun", row["findings"])]
        inside = sum(row["square"] < 3 * row["error"] for row in exact)
        off = middle([row["off"] for row in exact])
        ratio = middle([row["variance"] for row in exact if row["variance"]])
        print(f"| {name.replace('+', '/')} | {len(found)} | {len(exact)} | {inside} | {off:.0%} | {ratio:.2f} |")
    print(f"\nMore than {args.off:.0%} of blocks off by more than 10 %:\n")
    print("| scene | ours / Mitsuba, mean | systematic difference | blocks off | variance, ours / Mitsuba | what is said |")
    print("|---|---|---|---|---|---|")
    for row in sorted(done, key=lambda r: r["file"]):
        if row["off"] > args.off:
            mean = " ".join(f"{x:.3f}" for x in row["mean"])
            variance = "-" if row["variance"] is None else f"{row['variance']:.2f}"
            said = "; ".join(row["findings"].split(" | "))[:160]
            print(f"| {row['file']} | {mean} | {row['square']:.1e} ± {row['error']:.0e} | {row['off']:.0%} | {variance} | {said} |")
    print(f"\n{len(done)} compared, {len(rows) - len(done)} that Mitsuba does not read or not in time:")
    failed = (row["failed"].replace("\n", " ") for row in rows if "failed" in row)
    for reason, files in Counter(re.sub(r"^.*?(?:\)|\]):? ", "", text)[:100] for text in failed).most_common():
        print(f"{files} {reason}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["survey", "compare", "table"])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="of compare and table, the first is OUT")
    parser.add_argument("--bin", type=Path, default=Path("target/release/examples"), help="where survey and halves are")
    parser.add_argument("--edge", type=int, default=128, help="pixels of the longer side [128]")
    parser.add_argument("--spp", type=int, default=64, help="samples a pixel of each of the two pictures [64]")
    parser.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba [llvm_ad_rgb]")
    parser.add_argument("--off", type=float, default=0.04, help="share of blocks from which table lists a scene [0.04]")
    parser.add_argument("--only", help="of compare: files whose path contains this regular expression")
    parser.add_argument("--timeout", type=float, default=120, help="seconds for both of our pictures [120]")
    args = parser.parse_args()
    if args.what != "survey":
        args.out, *args.folders = args.folders
    {"survey": survey, "compare": compare, "table": table}[args.what](args)


if __name__ == "__main__":
    sys.exit(main())
