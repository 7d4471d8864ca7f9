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

#: Time between two bars, and between two lines where nothing can be drawn over, s.
PAUSE_OF_A_BAR, PAUSE_OF_LINES = 0.1, 30.0
#: Characters of a bar.
WIDTH = 24


def command(program: str, *arguments: FilePath) -> None:
    """Runs a command of a program, whose notes go to `sys.stderr`."""
    _dempm.command(program, [os.fspath(argument) for argument in arguments], Watcher(show=False))


class Watcher:
    """Shows progress by a bar that is drawn over in terminals and notebooks, else by a line now and then; and passes
    warnings on to Python."""

    def __init__(self, show: bool):
        self._show = show
        self._is_drawn_over = sys.stderr.isatty() or "ipykernel" in sys.modules
        self._pause = PAUSE_OF_A_BAR if self._is_drawn_over else PAUSE_OF_LINES
        #: Time and steps at the first report.
        self._begin: tuple[float, int] | None = None
        self._shown = time.monotonic()
        self._drawn = ""

    def __enter__(self) -> Watcher:
        return self

    def __exit__(self, *_: object) -> None:
        if self._drawn:
            print(file=sys.stderr, flush=True)

    def progress(self, done: int, all: int, remark: str) -> None:
        now = time.monotonic()
        if not self._show or (now - self._shown < self._pause and done < all):
            return
        self._shown = now
        text = self._bar(now, done, all) if all > 0 else remark
        if self._is_drawn_over:
            self._draw(text)
        else:
            print(text, file=sys.stderr, flush=True)

    def warning(self, text: str) -> None:
        if self._drawn:
            self._draw("")
        # As if who called the package had warned.
        frame, level = sys._getframe(), 1
        while frame.f_back and Path(frame.f_code.co_filename).parent == Path(__file__).parent:
            frame, level = frame.f_back, level + 1
        warnings.warn(text, stacklevel=level)

    def note(self, text: str) -> None:
        print(text, end="", file=sys.stderr, flush=True)

    def _draw(self, text: str) -> None:
        """Draws over what was drawn before."""
        print(f"\r{text:<{len(self._drawn)}}", end="" if text else "\r", file=sys.stderr, flush=True)
        self._drawn = text

    def _bar(self, now: float, done: int, all: int) -> str:
        if self._begin is None:
            self._begin = (now, done)
        begin, before = self._begin
        full = done * WIDTH // all
        text = f"{'█' * full}{'░' * (WIDTH - full)} {100 * done // all:3} %  {done}/{all}"
        if done > before and now > begin:
            rate = (done - before) / (now - begin)
            text += f"  {rate:.0f} steps/s  {(all - done) / rate:.0f} s left"
        return text
