"""Calibration of grains."""

import numpy as np
import pytest

import dempm

#: Eight sets of 30 discs, sheared fast: a second. Too few to find anything.
TARGETS = {
    "method": {"members": 8, "packings": 1, "rounds": 1, "points": 3, "inertial_number": 0.05},
    "rve": {"discs": 30},
    "free": {"friction": {"range": [0.1, 0.8]}},
    "target": [{"kind": "critical-friction", "pressure": 20e3, "angle": 16.0, "sd": 2.0}],
}


def test_a_calibration_is_read_from_its_folder(tmp_path):
    found = dempm.calibrate(TARGETS, tmp_path / "sand")
    friction = found.parameters["friction"]
    assert found.grains["friction"] == friction["mean"]
    assert 0.1 < friction["interval"][0] < friction["mean"] < friction["interval"][1] < 0.8
    assert friction["determined"] in ("well", "weakly", "not")
    assert found.law is None
    assert len(found.identifiability) == 1
    # The first ensemble, and that after the round.
    assert sorted(found.members) == ["friction", "member", "misfit", "round"]
    assert len(found.members["misfit"]) == 2 * 8
    assert "friction" in repr(found)
    # The grains are those of a scene.
    scene = {"duration": 0.1, "domain": {"size": [1.0, 1.0]}, "column": [{"size": [0.5, 0.5]}]}
    dempm.check({**scene, "material": {"kind": "rve"}, "grains": found.grains})
    # What is finished is left.
    with pytest.raises(dempm.Error, match="resume"):
        dempm.calibrate(TARGETS, tmp_path / "sand")
    again = dempm.calibrate(TARGETS, tmp_path / "sand", resume=True)
    assert np.array_equal(again.members["misfit"], found.members["misfit"])


def test_tables_of_a_dictionary_are_relative_to_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    biaxial = {"kind": "biaxial", "data": "sand.csv", "pressure": 1e5, "sd": {"deviatoric_stress": 1e4}}
    with pytest.raises(dempm.Error, match=str(tmp_path / "sand.csv")):
        dempm.calibrate({**TARGETS, "target": [biaxial]}, "sand")
