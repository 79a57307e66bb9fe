#!/usr/bin/env python3
"""Checks the documentation's links, and builds it as one searchable book.

    docs/book.py                      checks, then builds target/book/html/index.html with mdBook
    docs/book.py --check              checks the pages alone

Pages stay where a forge shows them: beside the code that they describe. So they are copied into target/book/src,
together with all files that they link to, and mdBook runs there. Links are checked twice: in the pages, against the
files of the repository and the anchors that a forge makes of headings; and in the book, against the files and anchors
that mdBook made. Links to other sites are not followed. The places in the code that docs/paper.md names are checked.
"""

import argparse
import html
import os
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
BOOK = ROOT / "target/book"
SUMMARY = "docs/SUMMARY.md"
FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"\]\(<?([^()\s<>]+)>?(?:\s+\"[^\"]*\")?\)|(?:src|href)=\"([^\"]+)\"")
HEADING = re.compile(r"^#+ +(.*?) *#*$", re.MULTILINE)
PLACE = re.compile(r"`((?!crates/|fixtures/|examples/)([a-z]+)/([\w/.]*))`((?: `[A-Za-z_:]+`,?)*)")
INDEX = re.compile(r"README\.md(?=$|[)#])")
HREF = re.compile(r"\b(?:href|src)=\"([^\"]+)\"")
ID = re.compile(r"(?:id|name)=\"([^\"]+)\"")


def tracked():
    """All files of the repository, new ones included."""
    names = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
                           cwd=ROOT, check=True, text=True, stdout=subprocess.PIPE).stdout
    return sorted(name for name in names.split("\0") if name and (ROOT / name).is_file())


def anchors(text):
    """What a forge calls the headings of a page."""
    seen, names = {}, set(ID.findall(text))
    for heading in HEADING.findall(FENCE.sub("", text)):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").replace("*", "")
        name = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
        count = seen[name] = seen.get(name, -1) + 1
        names.add(f"{name}-{count}" if count else name)
    return names


def check_pages(pages):
    """What is wrong with links in the pages, and the files that they link to."""
    texts = {page: (ROOT / page).read_text() for page in pages}
    files, faults, linked = set(tracked()), [], set()
    folders = {parent.as_posix() for file in files for parent in pathlib.PurePath(file).parents}
    for page, text in texts.items():
        prose = CODE.sub("", FENCE.sub("", text))
        for target in (a or b for a, b in LINK.findall(prose)):
            url = urllib.parse.urlsplit(target)
            if url.scheme:
                continue
            path = os.path.normpath(os.path.join(os.path.dirname(page), urllib.parse.unquote(url.path)))
            file = path if url.path else page
            if file not in files and file not in folders:
                faults.append(f"{page}: {target}: there is no {file}")
            elif url.fragment and url.fragment not in anchors(texts.get(file, "")):
                faults.append(f"{page}: {target}: no heading of {file} is called so")
            linked.add(file)
        # A comment that begins a line would make the whole line HTML.
        for number, line in enumerate(text.splitlines(), 1):
            if re.match(r"<!--=[^>]*-->.", line):
                faults.append(f"{page}:{number}: move the mark of the number behind a word")
    listed = {os.path.normpath(f"docs/{a}") for a, _ in LINK.findall(texts[SUMMARY])}
    for page in sorted(set(pages) - listed - {SUMMARY}):
        faults.append(f"{page}: the book would lack it, since {SUMMARY} does not list it")
    return faults, linked & files


def check_places(page):
    """What is wrong with the places that a page names: `core/film.rs` `Film::image`, a file and names in it."""
    faults = []
    for place, folder, path, names in PLACE.findall((ROOT / page).read_text()):
        crate = "noisefloor" if folder == "core" else f"noisefloor-{folder}"
        home = next((home for home in (ROOT / "crates", ROOT / "crates/lab") if (home / crate).exists()), ROOT)
        where = home / crate / "src" / path
        # A module may be a file, or a folder beside it.
        files = [file for file in (where, where.with_suffix("")) if file.exists()]
        files = [rust for file in files for rust in ([file] if file.is_file() else sorted(file.rglob("*.rs")))]
        text = "".join(file.read_text() for file in files)
        wanted = [name.split("::")[-1] for name in re.findall(r"`([^`]+)`", names)]
        missing = [name for name in wanted if not re.search(rf"\b{name}\b", text)]
        if not files:
            faults.append(f"{page}: there is no {place}")
        elif missing:
            faults.append(f"{page}: {place} does not contain {', '.join(missing)}")
    return faults


def stage(pages, linked):
    """Copies pages and what they link to. mdBook makes index.html of README.md, but leaves links to it alone."""
    shutil.rmtree(BOOK, ignore_errors=True)
    for file in {*pages, *linked} - {SUMMARY}:
        copy = BOOK / "src" / INDEX.sub("index.md", file)
        copy.parent.mkdir(parents=True, exist_ok=True)
        if file.endswith(".md"):
            copy.write_text(INDEX.sub("index.md", (ROOT / file).read_text()))
        else:
            shutil.copyfile(ROOT / file, copy)
    shutil.copyfile(ROOT / "docs/book.toml", BOOK / "book.toml")
    # The summary speaks of paths from the folder of the pages; mdBook wants them from the root.
    from_root = lambda link: f"]({os.path.normpath(os.path.join('docs', link[1]))})"
    summary = re.sub(r"\]\(([^)]+)\)", from_root, (ROOT / SUMMARY).read_text())
    (BOOK / "src/SUMMARY.md").write_text(INDEX.sub("index.md", summary))


def check_book(folder):
    """What is wrong with links in the book."""
    pages = {path: path.read_text() for path in sorted(folder.rglob("*.html"))}
    ids, faults = {path: set(ID.findall(text)) for path, text in pages.items()}, []
    for path, text in pages.items():
        if path.name in ("404.html", "print.html", "toc.html"): # these repeat the others, with a base of their own
            continue
        for link in HREF.findall(text):
            url = urllib.parse.urlsplit(html.unescape(link))
            if url.scheme or url.netloc:
                continue
            file = (path.parent / urllib.parse.unquote(url.path)).resolve() if url.path else path
            if not file.exists():
                faults.append(f"{path.relative_to(folder)}: {link}: there is no such file in the book")
            elif url.fragment and url.fragment not in ids.get(file, [url.fragment]):
                faults.append(f"{path.relative_to(folder)}: {link}: there is no such anchor in the book")
    return faults


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="check the pages, and build nothing")
    args = parser.parse_args()
    pages = [file for file in tracked() if file.endswith(".md")]
    faults, linked = check_pages(pages)
    faults += check_places("docs/paper.md")
    if not args.check:
        stage(pages, linked)
        subprocess.run(["mdbook", "build", BOOK], check=True)
        faults += check_book(BOOK / "html")
    print("\n".join(faults) or f"{len(pages)} pages, and every link leads somewhere")
    sys.exit(1 if faults else 0)
