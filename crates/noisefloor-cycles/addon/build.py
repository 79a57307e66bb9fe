#!/usr/bin/env python3
"""Packs the add-on for Blender: build.py OUT.zip WHEEL...

WHEEL is what `pip wheel --no-deps crates/noisefloor-python` makes, one for each platform. OUT.zip is an
extension for Blender 4.2 and later, and an add-on for versions before; both are installed from the file.
Needs only the standard library.
"""

import pathlib
import sys
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
# The version of the workspace, by which the wheel is called too
MANIFEST = """schema_version = "1.0.0"

id = "noisefloor"
version = "{version}"
name = "noisefloor"
tagline = "Cycles samples each tile until people stop seeing noise"
maintainer = "The noisefloor authors"
type = "add-on"
tags = ["Render"]
blender_version_min = "4.2.0"
license = ["SPDX:MIT", "SPDX:Apache-2.0"]
platforms = [{platforms}]
wheels = [{wheels}]

[permissions]
files = "Write maps and a summary beside rendered pictures"
"""
PLATFORMS = {
    ("linux", "x86_64"): "linux-x64",
    ("linux", "aarch64"): "linux-arm64",
    ("win", "amd64"): "windows-x64",
    ("win", "arm64"): "windows-arm64",
    ("macosx", "x86_64"): "macos-x64",
    ("macosx", "arm64"): "macos-arm64",
}


def platform(wheel):
    tag = wheel.stem.split("-")[-1].replace("many", "").replace("musl", "")
    for (system, machine), name in PLATFORMS.items():
        if tag.startswith(system) and tag.endswith(machine):
            return name
    raise SystemExit(f"{wheel.name}: no platform of Blender's is called {tag}")


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    out, wheels = pathlib.Path(sys.argv[1]), [pathlib.Path(name) for name in sys.argv[2:]]
    manifest = MANIFEST.format(
        version=wheels[0].name.split("-")[1],
        platforms=", ".join(f'"{name}"' for name in sorted({platform(wheel) for wheel in wheels})),
        wheels=", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels),
    )
    crates = HERE.parent.parent
    files = {path.name: path for path in sorted((HERE / "noisefloor_addon").glob("*.py"))}
    files["host.py"] = crates / "noisefloor-sidecar" / "host" / "host.py"
    for licence in ["LICENSE-MIT", "LICENSE-APACHE"]:
        files[licence] = crates / "noisefloor-cycles" / licence
    for wheel in wheels:
        files[f"wheels/{wheel.name}"] = wheel
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("noisefloor_addon/blender_manifest.toml", manifest)
        for name, path in files.items():
            archive.write(path, f"noisefloor_addon/{name}")
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
