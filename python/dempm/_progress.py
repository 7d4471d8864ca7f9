"""What commands say while they run, in a notebook or a terminal."""

from __future__ import annotations

import os
import sys
import time
import warnings
from pathlib import Path
from typing import Any

from . import _dempm
from ._scene import FilePath

#: Time between two lines where nothing can be drawn over, s.
PAUSE = 30.0


def command(program: str, *arguments: FilePath) -> None:
    """Runs a command of a program, whose notes go to `sys.stderr`."""
    _dempm.command(program, [os.fspath(argument) for argument in arguments], Watcher(show=False))


class Watcher:
    """Shows progress by a bar of tqdm if it is installed, else by lines, and passes warnings on to Python."""

    def __init__(self, show: bool):
        self._show = show
        self._bar: Any = None
        self._shown = time.monotonic()

    def __enter__(self) -> Watcher:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def progress(self, done: int, all: int, remark: str) -> None:
        if not self._show:
            return
        if all == 0:
            self._line(remark)
        elif self._bar is None and not self._has_bar(all, done):
            self._line(f"step {done} of {all}")
        if self._bar is not None:
            self._bar.update(done - self._bar.n)

    def warning(self, text: str) -> None:
        # As if who called the package had warned.
        frame, level = sys._getframe(), 1
        while frame.f_back and Path(frame.f_code.co_filename).parent == Path(__file__).parent:
            frame, level = frame.f_back, level + 1
        warnings.warn(text, stacklevel=level)

    def note(self, text: str) -> None:
        print(text, end="", file=sys.stderr, flush=True)

    def _has_bar(self, all: int, done: int) -> bool:
        if not (sys.stderr.isatty() or "ipykernel" in sys.modules):
            return False
        try:
            with warnings.catch_warnings():
                # Without widgets the bar is one of text.
                warnings.simplefilter("ignore")
                from tqdm.auto import tqdm

                self._bar = tqdm(total=all, initial=done, unit="step", unit_scale=True)
        except ImportError:
            return False
        return True

    def _line(self, text: str) -> None:
        now = time.monotonic()
        if now - self._shown >= PAUSE:
            self._shown = now
            print(text, file=sys.stderr, flush=True)
