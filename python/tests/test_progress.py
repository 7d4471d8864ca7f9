"""What is shown while a run goes on."""

import sys

import pytest
from conftest import LAW, ROOT, SCENE

import dempm
from dempm import _progress


def test_a_bar_is_drawn_over_in_a_terminal(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(_progress, "PAUSE_OF_A_BAR", 0.0)
    dempm.run(LAW, device="cpu")
    shown = capsys.readouterr().err
    bars = shown.strip().split("\r")
    assert bars[-1].startswith("█" * 24 + " 100 %  1000/1000")
    # The last bar stays, and what follows has a line of its own.
    assert shown.endswith("\n")


def test_lines_are_rare_elsewhere(capsys, monkeypatch):
    monkeypatch.setattr(_progress, "PAUSE_OF_LINES", 3600.0)
    dempm.run(LAW, device="cpu")
    # The end is always told.
    assert len(capsys.readouterr().err.splitlines()) == 1
    dempm.run(LAW, device="cpu", progress=False)
    assert capsys.readouterr().err == ""


def test_notes_of_a_command_go_to_the_standard_error_of_python(capsys, learned):
    model = ROOT / "models/tgnns-tiny.safetensors"
    capsys.readouterr()
    dempm.surrogate.rollout(model, learned, frames=5, device="cpu")
    said = capsys.readouterr()
    assert "expected error" in said.err
    assert said.out == ""


def test_warnings_point_to_the_caller():
    with pytest.warns(UserWarning, match="noisy material") as warned:
        dempm.run({**SCENE, "duration": 0.01}, device="cpu", progress=False)
    assert warned[0].filename == __file__
