"""Puts CMake from PyPI into DIRECTORY/bin, with nothing but Python's standard library.

Usage: get_cmake.py DIRECTORY. The variable PIP_INDEX_URL names another package index.
"""

import io
import os
import platform
import re
import ssl
import subprocess
import sys
import urllib.parse
import urllib.request
import zipfile
from pathlib import Path

WANTED = "cmake>=3.26"


def by_venv(directory):
    """The usual way. Debian's Python lacks it without the package python3-venv."""
    run(sys.executable, "-m", "venv", directory)
    run(directory / "bin" / "pip", "install", "--quiet", WANTED)


def by_pip(directory):
    """Where there is pip but no venv."""
    target = directory / "cmake-wheel"
    run(sys.executable, "-m", "pip", "install", "--quiet", "--target", target, WANTED)
    link(target, directory)


def by_hand(directory):
    """Where there is neither: a wheel is a zip archive."""
    index = os.environ.get("PIP_INDEX_URL", "https://pypi.org/simple").rstrip("/") + "/cmake/"
    page = fetch(index).decode()
    system = {"linux": "manylinux", "darwin": "macosx"}[sys.platform]
    machine = {"arm64": "aarch64"}.get(platform.machine(), platform.machine())
    wheels = []
    for href in re.findall(r'href="([^"#]+\.whl)', page):
        name = href.rsplit("/", 1)[-1]
        version = re.match(r"cmake-([\d.]+)-py3-none-", name)
        fits = machine in name or "universal2" in name
        if version and system in name and fits:
            wheels.append(([int(part) for part in version[1].split(".")], href))
    if not wheels or max(wheels)[0] < [3, 26]:
        raise RuntimeError(f"{index} has no CMake for {system} on {machine}")
    target = directory / "cmake-wheel"
    archive = fetch(urllib.parse.urljoin(index, max(wheels)[1]))
    zipfile.ZipFile(io.BytesIO(archive)).extractall(target)
    link(target, directory)


def link(wheel, directory):
    """Makes the program of an unpacked wheel executable and DIRECTORY/bin/cmake a link to it."""
    program = wheel / "cmake" / "data" / "bin" / "cmake"
    program.chmod(0o755)
    place = directory / "bin" / "cmake"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.unlink(missing_ok=True)
    place.symlink_to(program.resolve())


def fetch(url):
    certificates = os.environ.get("PIP_CERT") or os.environ.get("REQUESTS_CA_BUNDLE")
    context = ssl.create_default_context(cafile=certificates)
    with urllib.request.urlopen(url, timeout=60, context=context) as answer:
        return answer.read()


def run(*command):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError((done.stderr or done.stdout).strip())


def main():
    directory = Path(sys.argv[1])
    print(f"Getting CMake from PyPI into {directory}", file=sys.stderr)
    failures = []
    for way in (by_venv, by_pip, by_hand):
        try:
            way(directory)
            run(directory / "bin" / "cmake", "--version")
            return
        except Exception as failure:  # whatever goes wrong, the next way may do
            lines = str(failure).splitlines() or [repr(failure)]
            failures.append(f"{way.__name__}: {lines[-1]}")
    sys.exit("\n".join(failures))


if __name__ == "__main__":
    main()
