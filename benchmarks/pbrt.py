#!/usr/bin/env python3
"""Scenes of pbrt: how far our pictures are from those of rs_pbrt (pbrt-v3 in Rust) and of references beside scenes.

    pbrt.py made OUT                 makes small scenes, one for each material, light and shape; renders them by both;
                                     prints the table
    pbrt.py beside OUT FOLDER...     renders scenes that have a picture TungstenRender.exr beside them; prints the table

made needs the command rs_pbrt (cargo install rs_pbrt); both need the example halves of noisefloor-scenefile, and an
environment with Mitsuba 3, whose reader of pictures and whose numbers (scenes.py) they use. References are downscaled
to --edge pixels. OUT gets the scenes and sheets of ours, theirs and the difference.

The systematic difference is that of scenes.py, with one picture of theirs in place of two: it contains their noise.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

from scenes import draw, measured

HEAD = """LookAt 0 1.6 4  0 0.6 0  0 1 0
Camera "perspective" "float fov" [40]
Sampler "random" "integer pixelsamples" [{spp}]
PixelFilter "box" "float xwidth" [0.5] "float ywidth" [0.5]
Integrator "path" "integer maxdepth" [8]
Film "image" "integer xresolution" [{edge}] "integer yresolution" [{edge}] "string filename" ["a.png"]
WorldBegin
"""
FLOOR = """Material "matte" "rgb Kd" [0.5 0.4 0.3]
Shape "trianglemesh" "point P" [-3 0 3  3 0 3  3 0 -2  -3 0 -2] "integer indices" [0 1 2 0 2 3]
Material "matte" "rgb Kd" [0.3 0.4 0.5]
Shape "trianglemesh" "point P" [-3 0 -2  3 0 -2  3 4 -2  -3 4 -2] "integer indices" [0 1 2 0 2 3]
"""
LAMP = """AttributeBegin
AreaLightSource "diffuse" "rgb L" [3 3 3]
Material "matte" "rgb Kd" [0 0 0]
Shape "trianglemesh" "point P" [-1 3 1  -1 3 -1  1 3 -1  1 3 1] "integer indices" [0 1 2 0 2 3]
AttributeEnd
LightSource "infinite" "rgb L" [0.15 0.15 0.15]
"""
BALL = 'Translate 0 0.7 0\nShape "sphere" "float radius" [0.7]\n'
MATERIALS = {
    "matte": '"matte" "rgb Kd" [0.6 0.5 0.2]',
    "matte, sigma 20": '"matte" "rgb Kd" [0.6 0.5 0.2] "float sigma" [20]',
    "plastic": '"plastic" "rgb Kd" [0.3 0.2 0.1] "rgb Ks" [0.4 0.4 0.4] "float roughness" [0.1]',
    "plastic, no remapping": '"plastic" "rgb Kd" [0.3 0.2 0.1] "rgb Ks" [0.4 0.4 0.4] "float roughness" [0.2] '
    '"bool remaproughness" ["false"]',
    "plastic, roughness 0": '"plastic" "rgb Kd" [0.3 0.2 0.1] "rgb Ks" [0.4 0.4 0.4] "float roughness" [0]',
    "metal": '"metal" "float roughness" [0.01]',
    "metal, roughness 0": '"metal" "float roughness" [0]',
    "metal, rough": '"metal" "float roughness" [0.3] "bool remaproughness" ["false"]',
    "glass": '"glass"',
    "glass, rough": '"glass" "float uroughness" [0.2] "float vroughness" [0.2] "bool remaproughness" ["false"]',
    "mirror": '"mirror" "rgb Kr" [0.9 0.8 0.7]',
    "uber": '"uber" "rgb Kd" [0.3 0.3 0.1] "rgb Ks" [0.3 0.3 0.3] "float roughness" [0.2] '
    '"bool remaproughness" ["false"]',
    "uber, mirror": '"uber" "rgb Kd" [0.3 0.3 0.1] "rgb Ks" [0.3 0.3 0.3] "rgb Kr" [0.9 0.9 0.9] "float roughness" [0.2] '
    '"bool remaproughness" ["false"]',
    "uber, half opaque": '"uber" "rgb Kd" [0.5 0.3 0.1] "rgb Ks" [0 0 0] "rgb opacity" [0.5 0.5 0.5]',
    "substrate": '"substrate" "rgb Kd" [0.4 0.3 0.1] "rgb Ks" [0.1 0.1 0.1] "float uroughness" [0.2] '
    '"float vroughness" [0.2] "bool remaproughness" ["false"]',
    "translucent": '"translucent" "rgb Kd" [0.4 0.4 0.4] "rgb Ks" [0 0 0]',
}
LIGHTS = {
    "area, triangles": LAMP.replace('LightSource "infinite" "rgb L" [0.15 0.15 0.15]\n', ""),
    "area, sphere": 'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [8 8 8]\nTranslate 1 2.5 1\n'
    'Shape "sphere" "float radius" [0.3]\nAttributeEnd\n',
    "area, disk": 'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [8 8 8]\nTranslate 0 2.8 0\n'
    'Rotate 90 1 0 0\nShape "disk" "float radius" [0.5]\nAttributeEnd\n',
    "distant": 'LightSource "distant" "point from" [1 2 1] "point to" [0 0 0] "rgb L" [1 1 1]\n',
    "point": 'LightSource "point" "point from" [1 3 1] "rgb I" [4 4 4]\n',
    "point, scaled": 'LightSource "point" "point from" [1 3 1] "rgb I" [4 4 4] "rgb scale" [0.5 1 0.5]\n',
    "spot": 'LightSource "spot" "point from" [1 3 1] "point to" [0 0.5 0] "rgb I" [9 9 9] "float coneangle" [25] '
    '"float conedeltaangle" [10]\n',
    "infinite": 'LightSource "infinite" "rgb L" [0.5 0.4 0.3]\n',
}
MATTE = 'Material "matte" "rgb Kd" [0.6 0.5 0.2]\n'
CHECKS = 'Texture "checks" "spectrum" "checkerboard" "float uscale" [8] "float vscale" [4] "rgb tex1" [0.1 0.1 0.1] ' \
    '"rgb tex2" [0.7 0.6 0.5]\nMaterial "matte" "texture Kd" "checks"\n'
SHAPES = {
    "sphere, texture": CHECKS + "Translate 0 0.7 0\nRotate -90 1 0 0\n" + BALL.split("\n")[1] + "\n",
    "cylinder": MATTE + 'Rotate -90 1 0 0\nShape "cylinder" "float radius" [0.5] "float zmin" [0] "float zmax" [1.4]\n',
    "disk": MATTE + 'Translate 0 0.7 0\nShape "disk" "float radius" [0.7]\n',
    "mirrored": "Scale -1 1 1\nTranslate 0.5 0 0\n" + MATTE + BALL,
    "instance": 'ObjectBegin "ball"\n' + MATTE + 'Shape "sphere" "float radius" [0.7]\nObjectEnd\n'
    'Translate 0 0.7 0\nObjectInstance "ball"\n',
    "subdivision": MATTE + 'Shape "loopsubdiv" "integer levels" [3] "integer indices" '
    "[0 1 2 0 2 3 0 3 4 0 4 1 5 2 1 5 3 2 5 4 3 5 1 4] "
    '"point P" [0 1.6 0  0.9 0.7 0  0 0.7 -0.9  -0.9 0.7 0  0 0.7 0.9  0 0 0]\n',
    "normals": MATTE + 'Shape "trianglemesh" "point P" [-0.8 0 0  0.8 0 0  0 1.4 0] "integer indices" [0 1 2] '
    '"normal N" [-0.6 0 0.8  0.6 0 0.8  0 0.6 0.8]\n',
}


def made(args):
    """Name and text of each scene."""
    head = HEAD.format(spp=args.their_spp, edge=args.edge)
    for name, material in MATERIALS.items():
        yield f"material: {name}", head + LAMP + FLOOR + f"Material {material}\n" + BALL + "WorldEnd\n"
    for name, light in LIGHTS.items():
        yield f"light: {name}", head + light + FLOOR + MATTE + BALL + "WorldEnd\n"
    for name, shape in SHAPES.items():
        yield f"shape: {name}", head + LAMP + FLOOR + shape + "WorldEnd\n"


def read(path):
    import mitsuba as mi
    import numpy as np

    return np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))


def ours(args, file, size, root):
    command = [args.bin / "halves", file, "x".join(map(str, size)), str(args.spp), args.out / "ours"]
    run = subprocess.run(command, env=dict(os.environ, SCENE_ROOT=str(root)), capture_output=True, text=True)
    if run.returncode:
        raise RuntimeError(run.stderr.strip()[-200:])
    return [read(args.out / f"ours-{i}.exr") for i in (1, 2)]


def row(args, name, a, b):
    found, signed = measured(a, [b, b])
    draw(args.out / ("".join(c if c.isalnum() else "-" for c in name) + ".png"), a, [b, b], signed)
    mean = " ".join(f"{x:.3f}" for x in found["mean"])
    print(f"| {name} | {mean} | {found['square']:.1e} | {found['median']:.1%} | {found['off']:.0%} |", flush=True)


def compare_made(args):
    import numpy as np

    for name, text in made(args):
        if args.only and args.only not in name:
            continue
        folder = args.out / "".join(c if c.isalnum() else "-" for c in name)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "scene.pbrt"
        file.write_text(text)
        run = subprocess.run([args.rs_pbrt, "-p", "scene.pbrt"], cwd=folder, capture_output=True, text=True)
        try:
            a = ours(args, file, (args.edge, args.edge), folder)
            if run.returncode:
                raise RuntimeError("rs_pbrt: " + run.stderr.strip()[-150:].replace("\n", " "))
            # A PNG ends at 1
            row(args, name, [np.minimum(picture, 1) for picture in a], read(folder / "pbrt.png"))
        except RuntimeError as error:
            print(f"| {name} | {error} |", flush=True)


def compare_beside(args):
    import mitsuba as mi
    import numpy as np

    files = (f for folder in args.folders for f in sorted(folder.glob("**/*.pbrt")))
    for file in files:
        picture = file.with_name("TungstenRender.exr")
        if not picture.exists() or args.only and args.only not in str(file):
            continue
        try:
            b = mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
            scale = args.edge / max(b.size())
            size = [max(8, round(edge * scale / 8) * 8) for edge in b.size()]
            b = np.array(b.resample(size, mi.load_dict({"type": "box"})))
            # The depth of the reference is not always that of the file
            beside = file.with_name(f".{file.stem}-compared.pbrt")
            depth = f'"integer maxdepth" [ {args.depth} ]' if args.depth else r"\g<0>"
            beside.write_text(re.sub(r'"integer maxdepth" *\[ *\d+ *\]', depth, file.read_text()))
            try:
                a = ours(args, beside, size, file.parent.parent)
            finally:
                beside.unlink()
            row(args, str(file), a, b)
        except RuntimeError as error:
            print(f"| {file} | {error} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["made", "beside"])
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    parser.add_argument("--bin", type=Path, default=Path("target/release/examples"), help="where halves is")
    parser.add_argument("--rs-pbrt", default="rs_pbrt", help="the command [rs_pbrt]")
    parser.add_argument("--edge", type=int, default=64, help="pixels of the longer side [64]")
    parser.add_argument("--spp", type=int, default=256, help="our samples a pixel, twice [256]")
    parser.add_argument("--their-spp", type=int, default=1024, help="samples a pixel of rs_pbrt [1024]")
    parser.add_argument("--depth", type=int, help="of beside: pbrt's maxdepth in place of that of the files")
    parser.add_argument("--only", help="scenes with this in their name")
    args = parser.parse_args()
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    args.out = args.out.absolute()
    args.out.mkdir(parents=True, exist_ok=True)
    print("| scene | ours / theirs, mean | systematic difference | blocks' difference, median | blocks off by 10 % |")
    print("|---|---|---|---|---|")
    compare_made(args) if args.what == "made" else compare_beside(args)


if __name__ == "__main__":
    sys.exit(main())
