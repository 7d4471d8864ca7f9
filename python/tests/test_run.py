"""Trajectories, and the runs that make them."""

import signal
import threading
import time

import h5py
import numpy as np
import pytest
from conftest import LAW, ROOT, SCENE

import dempm


def test_arrays_are_those_of_the_file(run):
    with h5py.File(run.path) as file:
        assert np.array_equal(run.position[-1], file["position"][-1])
        assert np.array_equal(run["velocity"][3], file["velocity"][3])
        assert np.array_equal(run["budget/front"][()], file["budget/front"][()])
        assert np.array_equal(run.mass, file["points/mass"][()])
        assert run.budget.keys() == file["budget"].keys()
    assert (run.frames, run.points) == (len(run), len(run.mass)) == (11, 64)
    assert run.position.shape == (11, 64, 2)
    assert run.time == pytest.approx(np.arange(11) * 0.01)
    assert run.walls.shape == (3, 4) or run.walls.shape == (4, 4)
    assert run.boxes.shape == (11, 0, 4)


def test_pressure_and_speed_follow_from_stress_and_velocity(run):
    stress, velocity = run.stress[:], run.velocity[:]
    pressure = -(stress[..., 0] + stress[..., 3]) / 2
    assert np.array_equal(np.asarray(run.pressure), pressure)
    assert np.array_equal(run.pressure[-1], pressure[-1])
    assert run.pressure[3, 5] == pressure[3, 5]
    assert np.array_equal(run.pressure[2:9:3, :4], pressure[2:9:3, :4])
    assert np.array_equal(run.pressure[..., 7], pressure[..., 7])
    assert run.pressure.shape == pressure.shape
    # Round-off of a hypotenuse.
    assert run.speed[4] == pytest.approx(np.linalg.norm(velocity[4], axis=1), rel=1e-15)


def test_the_scene_has_its_defaults(run):
    assert run.scene["rve"]["discs"] == 32
    assert run.scene["grains"]["friction"] == 0.5
    assert run.scene["gravity"] == [0.0, -9.81]
    assert run.title == "Coarse column"
    assert run.status == "finished"
    assert len(run.warnings) == 0
    assert run.attributes["material"] == "rve"
    assert set(run.wall_time) >= {"mpm", "rve"}


def test_a_scene_can_be_changed_and_run_again(run):
    again = dempm.run({**run.scene, "duration": 0.02}, device="cpu", progress=False)
    # The same input on the same device gives the same bits.
    assert np.array_equal(again.position[-1], run.position[2])
    folder = again.path.parent
    again.close()
    assert not folder.exists()


def test_a_run_can_be_saved(run, tmp_path):
    law = dempm.run(LAW, device="cpu")
    kept = law.save(tmp_path / "kept.h5")
    law.close()
    assert kept.status == "finished"
    with pytest.raises(dempm.Error, match="is there already"):
        run.save(tmp_path / "kept.h5")
    assert [file.name for file in tmp_path.iterdir()] == ["kept.h5"]


def test_xarray(run):
    pytest.importorskip("xarray")
    dataset = run.to_xarray()
    last = dataset.sel(axis="y").isel(time=-1)
    assert np.array_equal(last["position"], run.position[-1, :, 1])
    assert dataset["pressure"].attrs["units"] == "Pa"
    assert dataset["front"].dims == ("time",)
    assert set(run.to_xarray(["position"]).data_vars) == {"position", "mass", *run.budget}


def test_errors_are_those_of_the_commands(run, tmp_path):
    with pytest.raises(dempm.Error, match="did you mean `column`"):
        dempm.run({**SCENE, "colunm": []})
    with pytest.raises(dempm.Error, match=r"coarse\.h5"):
        dempm.run(SCENE, run.path)
    with pytest.raises(dempm.Error, match="nothing.toml"):
        dempm.run(tmp_path / "nothing.toml")
    with pytest.raises(dempm.Error, match="leave out keys whose value is None"):
        dempm.run({**SCENE, "title": None})
    with pytest.raises(ValueError, match="valid: auto, cpu, cuda, cuda:N"):
        dempm.run(LAW, device="gpu")
    with pytest.raises(dempm.Error, match="cannot read .*no HDF5 file"):
        dempm.open(ROOT / "README.md")
    with pytest.raises(dempm.Error, match="cannot read nothing.h5: No such file or directory$"):
        dempm.open("nothing.h5")
    with pytest.raises(dempm.Error, match="output.fields"):
        dempm.run(LAW, device="cpu")["coordination"]
    with h5py.File(tmp_path / "other.h5", "w"), pytest.raises(dempm.Error, match="no trajectory"):
        dempm.open(tmp_path / "other.h5")


def test_other_threads_run_meanwhile():
    ticks, over = [], threading.Event()

    def tick():
        while not over.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    dempm.run(SCENE, device="cpu", progress=False)
    seconds = time.monotonic() - begin
    over.set()
    thread.join()
    # 100 a second, less what two busy cores take; none if the run kept Python's lock.
    assert len(ticks) > 10 * seconds


def test_an_interrupted_run_continues_with_the_same_bits(run, tmp_path):
    path = tmp_path / "interrupted.h5"
    # A run that comes to rest may end before the signal.
    scene = {**SCENE, "duration": 60.0, "stop_at_rest": False}
    timer = threading.Timer(2.0, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        dempm.run(scene, path, device="cpu", progress=False)
    interrupted = dempm.open(path)
    assert interrupted.status == "running"
    frames = interrupted.frames
    # Frames do not depend on how long the scene is.
    both = min(frames, run.frames)
    assert np.array_equal(interrupted.position[:both], run.position[:both])
    with pytest.raises(dempm.Error, match="resume|overwrite"):
        dempm.run(scene, path, device="cpu")
    timer = threading.Timer(2.0, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        dempm.run(scene, path, device="cpu", progress=False, resume=True)
    assert dempm.open(path).frames > frames
