#!/usr/bin/env python3
"""Holds every crate to its ceilings in sizes.txt (lines without tests, lines of tests, public items), and the README's
first command to the number of crates that it compiles.

Lines are all lines of Rust, also blank ones and comments. Tests are what lies in tests/, benches/, examples/ or fuzz/, and
a `#[cfg(test)] mod` at the end of a file. Public items are those that begin a line with `pub`.

--write lowers every ceiling to what stands. A ceiling is raised only with a reason, which its line then ends with:
--write "REASON"."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

LEDGER = Path(__file__).with_name("sizes.txt")
HEAD = "# crate                        lines   tests  public  # why it was raised; .ci/sizes.py --write\n"
TESTS = {"tests", "benches", "examples", "fuzz", "test"}
TEST_FILES = {"tests.rs", "test.rs", "build.rs"}
TEST_MODULE = re.compile(r"^#\[cfg\(test\)\]\n(?:#\[[^\n]*\]\n)*(?:pub(?:\([^)]*\))? )?mod \w+ \{", re.M)
PUBLIC = re.compile(
    r'^[ \t]*pub (?:(?:const|async|unsafe|extern "C") )*(?:fn|struct|enum|trait|const|static|type|mod|union|use)\b', re.M)


def output(*command):
    # Cargo shows its plan to whoever asks for what is not stable yet
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True,
                          env=os.environ | {"RUSTC_BOOTSTRAP": "1"}).stdout


def crates():
    """Lines without tests, lines of tests and public items, by crate."""
    sizes = {}
    for path in map(Path, output("git", "ls-files", "-co", "--exclude-standard", "*.rs").split("\n")[:-1]):
        if not path.exists():
            continue  # deleted, but not committed yet
        text = path.read_text()
        tested = TEST_MODULE.search(text)
        at = 0 if TESTS & set(path.parts[:-1]) or path.name in TEST_FILES else tested.start() if tested else len(text)
        new = (text[:at].count("\n"), text[at:].count("\n"), len(PUBLIC.findall(text[:at])))
        folder = "/".join(path.parts[:{"crates": 3 if path.parts[1] == "lab" else 2}.get(path.parts[0], 1)])
        sizes[folder] = tuple(map(sum, zip(sizes.get(folder, (0, 0, 0)), new)))
    return sizes


def first_build():
    """How many crates `cargo run --release` compiles, by cargo's own plan."""
    plan = output("cargo", "build", "--release", "--bin", "noisefloor", "--locked", "--unit-graph", "-Zunstable-options")
    return len({unit["pkg_id"] for unit in json.loads(plan)["units"]})


def main():
    sizes = crates() | {"(crates of a first build)": (first_build(),)}
    rows = {}
    for line in LEDGER.read_text().splitlines()[1:] if LEDGER.exists() else []:
        name, numbers, reason = re.match(r"(.{28})([ \d]*)(#.*)?", line).groups()
        rows[name.strip()] = tuple(map(int, numbers.split())), reason or ""
    raised = {name for name, size in sizes.items()
              if name not in rows or any(now > most for now, most in zip(size, rows[name][0]))}
    write, reason = sys.argv[1:2] == ["--write"], " ".join(sys.argv[2:])
    if raised and not (write and (reason or not rows)):
        print(*(f"{name}: {sizes[name]} is above {rows.get(name, ('nothing',))[0]}" for name in sorted(raised)), sep="\n")
        sys.exit('make it smaller, or say why it grows: .ci/sizes.py --write "REASON"')
    if write:
        why = {name: f"  # {reason}" if name in raised and reason else rows.get(name, ("", ""))[1] for name in sizes}
        lines = [f"{name:28}{''.join(f'{n:8}' for n in sizes[name])}  {why[name].strip()}" for name in sorted(sizes)]
        LEDGER.write_text(HEAD + "".join(line.rstrip() + "\n" for line in lines))
    print("lines without tests, lines of tests, public items:", *map(sum, zip(*(s for s in sizes.values() if len(s) == 3))))


main()
