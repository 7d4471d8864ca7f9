"""The commands as functions, and as programs of the environment."""

import struct
import subprocess

import numpy as np
import pytest
from conftest import BIN, LAW, ROOT, SCENE

import dempm

#: Simple shear of a loose packing of 50 discs, a fifth of a second.
TEST = {
    "sampling": 0.005,
    "rve": {"discs": 50, "preparation": {"pressure": 20e3}},
    "stage": [{"kind": "constant-pressure-shear", "pressure": 20e3, "shear_rate": 4.0, "strain": 0.1}],
}


def test_check_is_the_report_of_the_command_and_its_numbers():
    path = ROOT / "scenes/column.toml"
    check = dempm.check(path)
    printed = subprocess.run([BIN / "dempm", "check", path], capture_output=True, text=True, check=True).stdout
    # Speed and free memory are measured anew, and the columns are as wide as these numbers need.
    fixed = [text.split("Cost")[0].split() for text in (repr(check), printed)]
    assert fixed[0] == fixed[1]
    assert check["points"] == 1024
    assert check["steps"] == 12_000
    assert check["discs"] == 1024 * 64
    assert check["seconds"] > 0
    assert check["warnings"] == []
    assert any("noisy material" in warning for warning in dempm.check(SCENE)["warnings"])
    assert dempm.check(LAW)["discs"] is None


def test_a_model_is_chosen_and_run():
    path = ROOT / "scenes/column.toml"
    choice = dempm.choose(path, 0.2, device="cpu")
    taken = choice["candidates"][choice["taken"]]
    assert choice["within"] == 0.2
    assert taken["prediction"]["largest"]["median"] < taken["prediction"]["largest"]["bound"]
    # Whatever is taken is near enough, or nothing is.
    assert choice["met"] == (taken["out"] is None)
    assert f"> {taken['name']}" in repr(choice)
    # A share of the run-out is so many metres.
    share = dempm.choose(path, "5%", device="cpu")
    assert share["within"] == pytest.approx(0.05 * share["runout"])
    with pytest.raises(ValueError, match="metres"):
        dempm.choose(path, "near")
    # A network without a bound is out.
    model = ROOT / "models/tgnns-baseline.safetensors"
    network = dempm.choose(path, 0.2, learned=model, device="cpu")["candidates"][-1]
    assert network["family"] == "learned"
    assert "calibrate-error" in network["out"]
    with pytest.raises(ValueError, match="with `within` only"):
        dempm.run(path, learned=model)
    # What is chosen is run.
    scene = {**dempm._scene.values(path), "duration": 0.5}
    choice = dempm.choose(scene, 100, device="cpu")
    run = dempm.run(scene, within=100, device="cpu", progress=False)
    name = choice["candidates"][choice["taken"]]["name"]
    material = "discs" if name.startswith("discs") else "mu-i" if name.startswith("mu(I)") else "rve"
    assert run.attributes["material"] == material
    assert run.scene["choice"]["within"] == 100


def test_an_element_test_gives_the_path_of_the_command(tmp_path):
    file, table = tmp_path / "shear.toml", tmp_path / "shear.csv"
    file.write_text(dempm._scene.text_and_name(TEST)[0])
    subprocess.run([BIN / "dempm", "element", file, "-o", table], check=True, capture_output=True)
    written = np.genfromtxt(table, delimiter=",", names=True)
    path = dempm.element(TEST)
    for name in written.dtype.names:
        assert np.array_equal(path[name], written[name])
    assert np.array_equal(dempm.element(file)["syy"], path["syy"])
    assert list(path)[:3] == ["t", "exx", "exy"]
    assert path["t"] == pytest.approx(np.linspace(0, 0.025, 6))
    assert path["exy"] == pytest.approx(4.0 * path["t"])
    smooth = dempm.element(TEST, {"friction": 0.0})
    assert np.abs(smooth["sxy"]).max() < np.abs(path["sxy"]).max()
    with pytest.raises(dempm.Error, match="sampling"):
        dempm.element({**TEST, "sampling": -1.0})


def test_a_data_set(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    # Relative to the current folder, as everything that is not in a file.
    scenes = {
        "scene": "scenes/column-mu-i.toml",
        "set": {"duration": 0.02},
        "train": [{"grid": {"column.0.size": [[0.5, 0.5], [1.0, 0.5]]}}],
        "test": [{"scene": LAW}],
    }
    runs = dempm.dataset(scenes, tmp_path, device="cpu")
    assert [str(run.path.relative_to(tmp_path)) for run in runs] == ["test/000.h5", "train/000.h5", "train/001.h5"]
    assert {run.status for run in runs} == {"finished"}
    assert [run.points for run in runs] == [64, 64, 128]
    assert (tmp_path / "metadata.json").exists()
    only = dempm.dataset(scenes, tmp_path / "only", only=["test"], device="cpu")
    assert len(only) == 1
    with pytest.raises(dempm.Error, match="none.toml"):
        dempm.dataset("none.toml", tmp_path / "none")


def test_a_picture_is_that_of_the_command(run, tmp_path):
    picture = run.plot(field="pressure", times=[0.0, 0.05], width=400)
    width, _ = struct.unpack(">II", picture.png[16:24])
    assert width == 400
    file = tmp_path / "plot.png"
    options = ["--field=pressure", "--times=0.0,0.05", "--width=400", "-o", file]
    subprocess.run([BIN / "dempm", "plot", run.path, *options], check=True, capture_output=True)
    assert picture.png == file.read_bytes() == picture._repr_png_()
    with pytest.raises(dempm.Error, match="from 0 to 10"):
        dempm.plot(run.path, frames=[11])
    with pytest.raises(dempm.Error, match="no frame near 99 s"):
        dempm.plot(run.path, times=[99])
    with pytest.raises(dempm.Error, match="unexpected argument '--colour' found$"):
        dempm.plot(run, colour="red")


def test_two_runs_in_a_picture(run, tmp_path):
    other = dempm.run({**SCENE, "seed": 2}, tmp_path / "other.h5", device="cpu", progress=False)
    both = dempm.plot(run, other, times=[0.1], compare="overlay", width=400)
    assert both.png.startswith(b"\x89PNG")
    assert both.png != run.plot(times=[0.1], width=400).png


def test_a_prediction(learned):
    assert learned.attributes["material"].startswith("surrogate")
    assert learned.frames == 30
    again = dempm.surrogate.rollout(ROOT / "models/tgnns-tiny.safetensors", learned, frames=10, device="cpu")
    assert np.array_equal(again.position[:], learned.position[:10])
    with pytest.raises(dempm.Error, match="none.safetensors"):
        dempm.surrogate.rollout("none.safetensors", learned)


@pytest.mark.parametrize("program", ["dempm", "surrogate", "validation"])
def test_programs(program):
    def call(*arguments):
        return subprocess.run([BIN / program, *arguments], capture_output=True, text=True)

    assert call("--version").stdout == f"{program} {dempm.__version__}\n"
    assert "Usage:" in call("--help").stdout
    wrong = call("nonsense")
    assert wrong.returncode == 2
    assert "unrecognized subcommand" in wrong.stderr


def test_a_program_fails_as_the_binary(tmp_path):
    missing = subprocess.run([BIN / "dempm", "info", tmp_path / "none.h5"], capture_output=True, text=True)
    assert missing.returncode == 1
    assert "cannot open it" in missing.stderr
