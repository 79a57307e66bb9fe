#!/usr/bin/env python3
"""Makes the files of a release: an archive of both commands for this machine's platform, and checksums.

    release/archive.py FOLDER

What is committed is built, not what lies in the work tree: a copy of HEAD, with link-time optimisation, in
target/archive. The archive is unpacked into a prefix, `tar -xzf ARCHIVE -C /usr/local --strip-components 1`:

    bin/                                      noisefloor and noisefloor-lab
    share/man/man1/                           a page for each command
    share/bash-completion, zsh, fish          completions
    share/doc/noisefloor/                     README, changes, licences, also of all that is linked in
    share/doc/noisefloor/noisefloor.cdx.json  a bill of materials (CycloneDX 1.5)

It is unpacked into an empty folder at last, and both commands are run there with an empty environment. The same
commit, compiler and C library give the same bytes. Needs Rust, a C and a C++ compiler, and git; cargo-cyclonedx is
installed into target/archive.
"""

import argparse
import gzip
import hashlib
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "target/archive"
SOURCE = WORK / "source"
CLI = SOURCE / "crates/noisefloor-cli/Cargo.toml"
CYCLONEDX = "0.5.9"
COMMANDS = ("noisefloor", "noisefloor-lab")
COMPLETIONS = {
    "bash": "share/bash-completion/completions/{}",
    "zsh": "share/zsh/site-functions/_{}",
    "fish": "share/fish/vendor_completions.d/{}.fish",
}
LICENCES = ("licen", "copying", "notice", "unlicense", "copyright")  # how the names of such files begin


def run(*command, **options):
    """Runs a program that must succeed; what it printed."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, **options).stdout


def copy_head():
    """HEAD in a folder of its own, and when it was committed."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    with tarfile.open(fileobj=io.BytesIO(run("git", "archive", "HEAD", cwd=ROOT))) as head:
        head.extractall(SOURCE)
    return int(run("git", "show", "--no-patch", "--format=%ct", "HEAD", cwd=ROOT))


def build(environment):
    """Both commands. Where they were built, and by whom, is not in them."""
    home = os.environ.get("CARGO_HOME") or pathlib.Path.home() / ".cargo"
    folders = {SOURCE: "/noisefloor", home: "/cargo"}
    to_c = " ".join(f"-ffile-prefix-map={there}={name}" for there, name in folders.items())
    environment = environment | {
        "CARGO_TARGET_DIR": str(WORK / "build"),
        "CARGO_PROFILE_DIST_STRIP": "debuginfo",
        "CARGO_INCREMENTAL": "0",
        "RUSTFLAGS": " ".join(f"--remap-path-prefix={there}={name}" for there, name in folders.items()),
        "CFLAGS": to_c,
        "CXXFLAGS": to_c,
    }
    run("cargo", "build", "--profile", "dist", "--locked", "--features", "lab", "--bins",
        "--manifest-path", CLI, env=environment)
    return WORK / "build/dist"


def linked(host):
    """All packages that are linked into the commands, and those of procedural macros."""
    asked = ("--format-version", "1", "--locked", "--features", "lab", "--filter-platform", host)
    metadata = json.loads(run("cargo", "metadata", *asked, "--manifest-path", CLI))
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    todo, found = [metadata["resolve"]["root"]], set()
    while todo:
        package = todo.pop()
        if package not in found:
            found.add(package)
            todo += [dependency["pkg"] for dependency in nodes[package]["deps"]
                     if any(kind["kind"] is None for kind in dependency["dep_kinds"])]
    of_others = [package for package in metadata["packages"] if package["id"] in found and package["source"]]
    return sorted(of_others, key=lambda package: (package["name"], package["version"]))


def licences(packages):
    """The licences of what is linked in, as one text: each once, below the packages that it is of."""
    said, texts, bare = [], {}, []
    for package in packages:
        name = f"{package['name']} {package['version']}"
        said.append(f"{name}: {package['license']}")
        folder = pathlib.Path(package["manifest_path"]).parent
        files = [path for path in folder.rglob("*") if path.name.lower().startswith(LICENCES)]
        files = sorted(path for path in files if path.is_file() and path.suffix not in (".rs", ".py"))
        if not files:
            authors = ", ".join(package["authors"]) or "its authors"
            bare.append(f"{name}, by {authors}: {package['repository'] or 'no repository named'}")
        for path in files:
            users = texts.setdefault(path.read_text(errors="replace").strip(), [])
            if name not in users:
                users.append(name)
    parts = ["The commands contain Rust's standard library, and these packages of others:\n\n" + "\n".join(said)]
    parts.append("The packages of these have no text of their licence:\n\n" + "\n".join(bare))
    parts += [", ".join(users) + ":\n\n" + text for text, users in texts.items()]
    return f"\n\n{'-' * 78}\n\n".join(parts).encode()


def materials(host, environment):
    """The bill of materials, without the day on which it was made."""
    tools = WORK / "tools"
    run("cargo", "install", "cargo-cyclonedx", "--version", CYCLONEDX, "--locked", "--quiet", "--root", tools,
        env=os.environ | {"CARGO_TARGET_DIR": str(WORK / "tools-build")})
    run(tools / "bin/cargo-cyclonedx", "cyclonedx", "--manifest-path", CLI, "--features", "lab",
        "--target", host, "--format", "json", "--spec-version", "1.5", "--quiet", env=environment)
    text = CLI.with_name("noisefloor-cli.cdx.json").read_text()
    bill = json.loads(text.replace(f"file://{SOURCE}", "file:///noisefloor"))
    bill.pop("serialNumber", None)
    bill["metadata"].pop("timestamp", None)
    return json.dumps(bill, indent=1).encode()


def contents(host, environment):
    """All files of the archive: path, content."""
    built = build(environment)
    files = {f"bin/{name}": (built / name).read_bytes() for name in COMMANDS}
    with tempfile.TemporaryDirectory() as pages:
        for name in COMMANDS:
            for shell, place in COMPLETIONS.items():
                files[place.format(name)] = run(built / name, "completions", shell)
            run(built / name, "man", pages)
        for page in pathlib.Path(pages).iterdir():
            files[f"share/man/man1/{page.name}"] = page.read_bytes()
    doc = "share/doc/noisefloor"
    for name in ("README.md", "CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT"):
        files[f"{doc}/{name}"] = (SOURCE / name).read_bytes()
    files[f"{doc}/LICENSES-OF-OTHERS"] = licences(linked(host))
    files[f"{doc}/noisefloor.cdx.json"] = materials(host, environment)
    return files


def pack(name, files, committed):
    """A compressed archive of one folder, the same bytes for the same files."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for path, content in sorted(files.items()):
            entry = tarfile.TarInfo(f"{name}/{path}")
            entry.size, entry.mtime = len(content), committed
            entry.mode = 0o755 if path.startswith("bin/") else 0o644
            archive.addfile(entry, io.BytesIO(content))
    return gzip.compress(packed.getvalue(), mtime=0)


def try_out(archive):
    """Installs from the archive into an empty prefix, and runs what is there with nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        prefix = pathlib.Path(folder) / "prefix"
        prefix.mkdir()
        run("tar", "-xzf", archive, "-C", prefix, "--strip-components", "1")
        for name in COMMANDS:
            print(run(prefix / "bin" / name, "--version", env={}).decode().strip())
        run(prefix / "bin/noisefloor", "render", "cornell-box", "--size", "64x64", "--criterion", "spp:4",
            "--out", f"{folder}/box", env={}, stderr=subprocess.DEVNULL)
        if not (pathlib.Path(folder) / "box/image.exr").is_file():
            sys.exit("noisefloor rendered nothing")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    committed = copy_head()
    host = next(line[6:] for line in run("rustc", "-vV").decode().splitlines() if line.startswith("host: "))
    version = run("cargo", "pkgid", "--manifest-path", CLI).decode().strip().rpartition("#")[2]
    version = version.rpartition("@")[2]
    name = f"noisefloor-{version}-{host}"

    packed = pack(name, contents(host, os.environ | {"SOURCE_DATE_EPOCH": str(committed)}), committed)
    folder.mkdir(parents=True, exist_ok=True)
    archive = folder / f"{name}.tar.gz"
    archive.write_bytes(packed)
    (folder / "SHA256SUMS").write_text(f"{hashlib.sha256(packed).hexdigest()}  {archive.name}\n")
    try_out(archive)
    print(f"{archive}: {len(packed) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
