"""The programs `dempm`, `surrogate` and `validation`."""

import signal
import sys

from . import _dempm


def _run(program: str) -> None:
    # The program handles Ctrl-C itself where it has something to save, and ends otherwise.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_dempm.main(program, sys.argv))


def dempm() -> None:
    _run("dempm")


def surrogate() -> None:
    _run("surrogate")


def validation() -> None:
    _run("validation")
