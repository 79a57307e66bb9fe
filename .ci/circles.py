#!/usr/bin/env python3
"""Finds promised crates that stand on what is not promised, and circles of imports: files of one crate that need each
other. A module and its parts (`foo.rs` and what lies in `foo/`) are one story and may; other files that do are one story
in two places, or two stories in one.

Reads the paths in `use` declarations and in code, by the rules of the 2018 edition: `crate::`, `super::`, `self::` and
the names of modules. What a module hands on by `pub use` counts for the file that defines it. Tests are left out."""

import re
import sys
from pathlib import Path

# Of these, docs/architecture.md promises that their interfaces change only with a version
PROMISED = ["vision", "image", "denoise", "sidecar", "mitsuba", "luxcore", "cycles", "testkit"]
PATH = re.compile(r"(?<![\w:])((?:crate|self|super|[a-z_][a-z0-9_]*)(?:::\w+)+)")
USE = re.compile(r"\b(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);")


def plain(text):
    """The code without comments, strings and tests."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text)
    return re.split(r"#\[cfg\(test\)\]\s*mod ", text)[0]


def leaves(tree):
    """The paths of a `use` tree."""
    tree = tree.strip()
    if not tree.endswith("}"):
        return [re.split(r"\s+as\s+", tree)[0]]
    head, inside = tree[:-1].split("{", 1)
    parts, depth, part = [], 0, ""
    for letter in inside + ",":
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts, part = parts + [part], ""
        else:
            part += letter
    return [head.strip() + leaf for part in parts if part.strip() for leaf in leaves(part)]


class Crate:
    def __init__(self, root):
        folder = root.parent
        self.text = {}
        for file in folder.rglob("*.rs"):
            module = file.relative_to(folder).with_suffix("").parts
            if "bin" in module[:1] or "tests" in module:
                continue
            self.text[() if file == root else module] = plain(file.read_text())
        # Where names come from that a module hands on
        self.origin = {}
        for module, text in self.text.items():
            for public, tree in USE.findall(text):
                for leaf in leaves(tree) if public else []:
                    if found := self.find(leaf, module):
                        self.origin[module, leaf.split("::")[-1]] = found

    def find(self, path, module):
        """The module that a path leads to from a module, and the name in it."""
        words = path.split("::")
        at = () if words[0] == "crate" else module
        if words[0] in ("crate", "self"):
            words = words[1:]
        elif words[0] != "super" and (*module, words[0]) not in self.text:
            return None
        while words and words[0] == "super":
            at, words = at[:-1], words[1:]
        while words and (*at, words[0]) in self.text:
            at, words = (*at, words[0]), words[1:]
        found = (at, words[0] if words else None)
        return self.origin.get(found, found) if found[0] != module else None

    def edges(self):
        """Who needs whom, but for a module and its parts."""
        edges = {module: set() for module in self.text}
        for module, text in self.text.items():
            uses = [leaf for _, tree in USE.findall(text) for leaf in leaves(tree)]
            for path in uses + PATH.findall(USE.sub("", text)):
                if found := self.find(path, module):
                    other = found[0]
                    if other[: len(module)] != module and module[: len(other)] != other:
                        edges[module].add(other)
        return edges


def circles(edges):
    """Groups of modules of which each reaches each other one."""
    def reached(start):
        seen, todo = set(), [start]
        while todo:
            new = edges[todo.pop()] - seen
            seen |= new
            todo += new
        return seen

    reach = {module: reached(module) for module in edges}
    groups = {frozenset(b for b in reach[a] if a in reach[b]) for a in edges if a in reach[a]}
    return sorted(sorted(group) for group in groups)


def leaning():
    """Crates that are promised and use hidden modules of the core, which any release may change, without saying which one."""
    hidden = re.findall(r"#\[doc\(hidden\)\]\s*pub mod (\w+);", Path("crates/noisefloor/src/lib.rs").read_text())
    for crate in (Path("crates/noisefloor-" + name) for name in PROMISED):
        text = "".join(plain(file.read_text()) for file in crate.glob("src/**/*.rs"))
        paths = [leaf for _, tree in USE.findall(text) for leaf in leaves(tree)] + PATH.findall(text)
        used = {path for path in paths if path.split("::")[0] == "noisefloor" and path.split("::")[1] in hidden}
        if used and 'noisefloor = { path = "../noisefloor", version = "=' not in (crate / "Cargo.toml").read_text():
            yield crate.name, used


def main():
    """Of every crate, or of the library or program whose root file is given."""
    roots = [Path(root) for root in sys.argv[1:]] or sorted(
        file for pattern in ("crates/**/src/lib.rs", "crates/**/src/bin/*/main.rs") for file in Path().glob(pattern))
    found = 0
    for root in roots:
        crate = Crate(root)
        edges = crate.edges()
        for group in circles(edges):
            found += 1
            print(f"{root}: a circle of imports")
            for module in group:
                for other in sorted(edges[module] & set(group)):
                    print(f"    {'/'.join(module) or root.name} needs {'/'.join(other) or root.name}")
    for crate, used in leaning():
        sys.exit(f"{crate}: hidden parts of the core ({', '.join(sorted(used))}): promise them, or ask for one version, \"=…\"")
    if found:
        sys.exit("move what both need into a file of its own, or to the one that the other needs anyway")


main()
