#!/usr/bin/env python3
"""Checks the documentation without a network: links, anchors, images and paths of the repository.

1. Every relative link and image of a tracked Markdown file exists, and so does its anchor.
2. Pages of the book (docs/) are listed in docs/SUMMARY.md and link to nothing outside of docs/.
3. Paths of the repository named in text exist, except in the dated pages of docs/notes/.
4. Pages of the book named in other files (docs/<name>.md) exist.
"""

import re
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BOOK = ROOT / "docs"
LINK = re.compile(r"""(?:\]\(|<img[^>]* src=")([^)\s"]+)""")


def tracked():
    names = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.splitlines()
    return [name for name in names if (ROOT / name).is_file()]


def anchors(page):
    """Anchors of the headings of a page, as forges and mdBook make them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    found = set()
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")
        number = 0
        while (name := f"{slug}-{number}" if number else slug) in found:
            number += 1
        found.add(name)
    return found


def line_of(text, position):
    return text.count("\n", 0, position) + 1


def check_links(page, text):
    """Relative links of a page that lead nowhere."""
    def blank(match):
        return re.sub(r"[^\n]", " ", match.group())

    # An indented line that continues a list is no code, but has no effect on links either.
    visible = re.sub(r"^```.*?^```", blank, text, flags=re.MULTILINE | re.DOTALL)
    for match in LINK.finditer(visible):
        target = match.group(1)
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        where = line_of(text, match.start())
        if not file.exists():
            yield where, f"{target} does not exist"
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            yield where, f"{target}: there is no heading #{anchor}"
        elif page.is_relative_to(BOOK) and not file.is_relative_to(BOOK):
            yield where, f"{target} is outside of the book: name it as `path` instead"


def check_paths(text, names, folders):
    """Paths of the repository (with * for a part) and names of sources that do not exist."""
    top = "|".join(sorted(re.escape(name.split("/")[0]) for name in folders if "/" not in name))
    for match in re.finditer(rf"(?<![\w/.$~<-])(?:{top})/[\w./*-]+", text):
        path = match.group().rstrip(".")
        exists = path.rstrip("/") in folders or any(fnmatch(name, path) for name in names)
        if not exists and "..." not in path:
            yield line_of(text, match.start()), f"{path} does not exist"
    files = {name.rsplit("/", 1)[-1] for name in names}
    for match in re.finditer(r"`(\w+\.(?:rs|cuh?))`", text):
        if match.group(1) not in files:
            yield line_of(text, match.start()), f"there is no file {match.group(1)}"


def main():
    names = tracked()
    folders = {str(parent) for name in names for parent in Path(name).parents} - {"."}
    summary = set(LINK.findall((BOOK / "SUMMARY.md").read_text()))
    problems = []
    for name in names:
        file = ROOT / name
        try:
            text = file.read_text()
        except UnicodeDecodeError:
            continue
        found = []
        if file.suffix == ".md":
            found += check_links(file, text)
            if not name.startswith("docs/notes/"):
                found += check_paths(text, names, folders)
            if file.is_relative_to(BOOK) and file.name != "SUMMARY.md":
                if str(file.relative_to(BOOK)) not in summary:
                    found.append((1, "is not in docs/SUMMARY.md"))
        elif not name.startswith("docs/report/"):
            for match in re.finditer(r"docs/[\w/.-]+\.md", text):
                if not (ROOT / match.group()).exists():
                    found.append((line_of(text, match.start()), f"{match.group()} does not exist"))
        problems += [f"{name}:{line}: {problem}" for line, problem in found]
    print("\n".join(problems) or f"links of {sum(n.endswith('.md') for n in names)} pages are sound")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
