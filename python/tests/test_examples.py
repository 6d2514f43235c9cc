"""The examples run unchanged; that of Gymnasium is in test_gym.py. Ray and OpenTURNS are opt-in."""

import os
import re
import subprocess
import sys
from pathlib import Path

import fmurun
import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name, *arguments):
    command = [sys.executable, EXAMPLES / name, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_joblib_is_one_process(archives):
    """Loky's processes are new ones that unpickle the plan: the same bits as here."""
    sys.path.insert(0, str(EXAMPLES))
    import sweep_joblib

    results = sweep_joblib.main(archives / "fmi3", 200, 20)
    plan = fmurun.Plan(archives / "fmi3" / "PmsmDrive.fmu", start_values={"speed_ref": 20.0}, stop_time=0.2, step_size=1e-3,
                       measures={"dip": ("speed", "min"), "speed": "speed"})  # fmt: skip
    here = plan.run_many({"plant.motor.R_s": np.random.default_rng(7).normal(3.0, 0.1, 200)})
    for name in ("run", "dip", "speed", "end"):
        assert results[name].tobytes() == here[name].tobytes()


def test_dask(archives, tmp_path):
    """test_dask.py goes on with a folder that has results."""
    said = run("sweep_dask.py", archives / "fmi3", tmp_path / "out")
    assert "'skipped': 0" in said
    assert "'failed': 0" in said
    assert "1000 rows" in said


@pytest.mark.skipif("FMU_ENGINES" not in os.environ, reason="opt-in: cargo test --test python engines -- --ignored")
@pytest.mark.parametrize("name", ["sweep_ray.py", "openturns_drive.py"])
def test_engines(archives, name):
    said = run(name, archives / "fmi3")
    print(said)
    assert {"sweep_ray.py": "equal to one process: True", "openturns_drive.py": "speed plant.motor.R_s "}[name] in said


def test_the_notebook_of_the_vehicle(tmp_path, monkeypatch):
    sys.path.insert(0, str(Path(__file__).parents[2] / "tests/common"))
    import notebook

    notebook.check("vehicle.ipynb", tmp_path, monkeypatch)


def test_the_vehicle_with_three_drives(tmp_path):
    """The page has what the script prints and draws; the three drives use the same energy within 0.5 %."""
    motor = EXAMPLES.parent / "motors/traction-100kw.toml"
    command = [os.environ["FMU_COMMAND"], "map", motor, "--verify", "0", "--out", tmp_path]
    subprocess.run(command, check=True, capture_output=True)
    plot = tmp_path / "plot.svg"
    text = run("drive-train/vehicle.py", "PmsmDrive", "PmsmDriveMean", tmp_path / "map.csv", "--plot", plot)
    differences = [float(x) for x in re.findall(r"differs from PmsmDrive by ([+-][\d.]+) %", text)]
    assert len(differences) == 2
    assert max(map(abs, differences)) < 0.5
    if "UPDATE_GOLDEN" in os.environ:
        (EXAMPLES.parent / "docs/drive-train-vehicle.svg").write_text(plot.read_text())
    page = (EXAMPLES.parent / "docs/drive-train.md").read_text()
    shown = page[page.index("PmsmDrive: ", page.index("vehicle.py")) :].split("```")[0]
    numbers = lambda text: [float(x) for x in re.findall(r"[+-]?\d+\.\d+", text)]  # noqa: E731
    assert re.findall(r"[A-Za-z]+", shown) == re.findall(r"[A-Za-z]+", text), text
    assert numbers(shown) == pytest.approx(numbers(text), rel=2e-3, abs=2e-2), text
    labels = [re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text()) for path in (plot, EXAMPLES.parent / "docs/drive-train-vehicle.svg")]
    assert labels[0] == labels[1]
    assert "time [s]" in labels[0]


def test_the_fit_finds_the_values(standard):
    """The recorded run has noise of 1e-3: the true values are within the 95 % interval of the fit."""
    said = run("fit_scipy.py", standard / "PmsmPlant.fmu")
    found = re.findall(r"(motor\.\w+) = ([\d.]+) \+- ([\d.]+), true ([\d.]+)", said)
    assert [name for name, *_ in found] == ["motor.R_s", "motor.psi_M"], said
    for _, value, spread, true in found:
        assert 0.0 < float(spread) < 0.01 * float(true)
        assert abs(float(value) - float(true)) <= 2.0 * float(spread), said


def test_examples_are_short():
    for name in ("sweep_dask.py", "sweep_ray.py", "sweep_joblib.py", "openturns_drive.py", "gym_drive.py", "sweep_slurm.sh"):
        assert len((EXAMPLES / name).read_text().splitlines()) <= 30, name
