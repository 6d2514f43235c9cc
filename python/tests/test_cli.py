"""The command and the package: the same file gives the same bits (FMU_COMMAND names the command)."""

import csv
import os
import pickle
import subprocess
import textwrap

import numpy as np
import pytest
from fmurun import Plan

pytestmark = pytest.mark.skipif("FMU_COMMAND" not in os.environ, reason="FMU_COMMAND is not set")


def fmu(*arguments):
    done = subprocess.run([os.environ["FMU_COMMAND"], *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.fixture
def sweep(standard, tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(textwrap.dedent(f"""
        fmus = ['d={standard / "PmsmDrive.fmu"}']
        stop = 0.05
        step = 1e-3
        [input]
        'd.speed_ref' = '0:0,0.01:50'
        [design]
        kind = 'lhs'
        runs = 60
        seed = 3
        [vary]
        'd.plant.motor.R_s' = {{ normal = [3.0, 0.1] }}
        'd.plant.initial.theta_e' = {{ uniform = [-3.1, 3.1] }}
        'd.plant.mechanics.J' = {{ values = [1e-3, 2e-3, -1.0] }}
        'd.controller.estimator' = {{ values = ['Rasmussen', 'FluxObserver'] }}
        [measure]
        peak = {{ of = 'd.speed', is = 'max' }}
        estimator = {{ of = 'd.controller.estimator', is = 'final' }}
        error = {{ of = 'd.theta_est - d.theta_e', wrap = '2pi', is = 'rms' }}
    """))
    return path


def test_sweep_is_run_many(sweep, tmp_path):
    fmu("sweep", sweep, "--out", tmp_path / "out", "--jobs", 2)
    with open(tmp_path / "out" / "results.csv", newline="") as file:
        header, *lines = csv.reader(file)
    plan = Plan.from_toml(sweep)
    results = plan.run_many(plan.rows(0, len(plan)))
    assert len(lines) == len(plan) == 60
    measured = dict(zip(header, zip(*lines)))
    assert {"run", "d.plant.motor.R_s", "peak", "end"} <= set(measured)
    assert measured["run"] == tuple(map(str, results["run"]))
    assert header == list(results)
    assert header[-3:] == ["error", "end", "run.error"]
    ok = np.array([not error for error in results["run.error"]])
    assert 0 < ok.sum() < 60
    for name in ("d.plant.motor.R_s", "d.plant.initial.theta_e", "d.plant.mechanics.J"):
        assert [float(x) for x in measured[name]] == results[name].tolist()
    for name in ("peak", "error"):
        of_command = np.array([float(x or "nan") for x in measured[name]])
        assert of_command[ok].tobytes() == results[name][ok].tobytes()
        assert np.isnan(of_command[~ok]).all()
    assert [line[-1] for line in lines] == results["run.error"].tolist()
    assert set(measured["d.controller.estimator"]) == {"Rasmussen", "FluxObserver"}
    for name in ("d.controller.estimator", "estimator"):
        assert list(measured[name]) == results[name].tolist()


def test_simulate_is_simulate(standard, tmp_path):
    archive = standard / "PmsmDrive.fmu"
    plan = Plan({"d": archive}, input={"d.speed_ref": [(0.0, 0.0), (0.01, 50.0)]}, stop_time=0.05, step_size=1e-3,
                output=["d.speed", "d.theta_e"])  # fmt: skip
    for k, r_s in enumerate((2.9, 3.0, 3.1)):
        out = tmp_path / f"{k}.csv"
        fmu("simulate", f"d={archive}", "--set", f"d.plant.motor.R_s={r_s}", "--input", "d.speed_ref=0:0,0.01:50", "--stop", "0.05",
            "--step", "1e-3", "--record", "d.speed,d.theta_e", "--csv", out)  # fmt: skip
        with open(out, newline="") as file:
            _, *lines = csv.reader(file)
        ours = plan.simulate({"d.plant.motor.R_s": r_s})
        assert [[float(x) for x in line] for line in lines] == [list(row) for row in ours.tolist()]


def test_an_ssp_file(standard, tmp_path):
    """Names without a dot are connectors of the system."""
    ssp, out = tmp_path / "drive.ssp", tmp_path / "out.csv"
    fmu("ssp", "--fmus", standard, "--out", ssp, *(["--fmi", "3"] if standard.name == "fmi3" else []))
    fmu("simulate", ssp, "--input", "speed_ref=0:0,0.01:50", "--input", "u_dc=325", "--stop", "0.05", "--step", "1e-4", "--csv", out)
    with open(out, newline="") as file:
        header, *lines = csv.reader(file)
    inputs = {"speed_ref": [(0.0, 0.0), (0.01, 50.0)], "u_dc": 325.0}
    plan = Plan(ssp, input=inputs, stop_time=0.05, step_size=1e-4, measures={"last": header[1]})
    ours = plan.simulate()
    assert list(ours.dtype.names) == header
    assert [[float(x) for x in line] for line in lines] == [list(row) for row in ours.tolist()]
    arguments = {"input": inputs, "stop_time": 0.05, "step_size": 1e-4, "output": header[1:]}
    exchanged = Plan(ssp, fmi_type="ModelExchange", relative_tolerance=1e-9, **arguments).simulate()
    assert all(np.allclose(exchanged[name], ours[name], rtol=1e-4, atol=1e-3) for name in header if "speed" in name)
    again = pickle.loads(pickle.dumps(Plan(ssp, input=inputs, stop_time=0.05, step_size=1e-4, embed=True)))
    assert again.simulate().tobytes() == ours.tobytes()
