"""FMUs of other tools through `fmu simulate` and through FMPy, in the same steps: PythonFMU, pythonfmu3, fmucontainer."""

import csv
import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from shutil import copy

import numpy as np
import pytest
from fmpy import simulate_fmu

COMMAND = os.environ.get("FMU_COMMAND")
STEP, STOP = 0.125, 2.0  # s: a binary fraction, because FMPy passes differences of times as steps

INTEGRATOR = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String

class Counter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.n, self.on, self.text = 0.0, 0.0, 0, False, "at rest"
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Integer("n", causality=Fmi2Causality.output))
        self.register_variable(Boolean("on", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))
        self.register_variable(String("text", causality=Fmi2Causality.output))

    def do_step(self, t, dt):
        self.y += self.u * dt
        self.n, self.on, self.text = self.n + 1, self.y > 1.0, f"step {self.n}, done"
        return True
"""

INTEGRATOR3 = """
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Int64

class Counter3(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.u, self.y, self.n = 0.0, 0.0, 0.0, 2**53
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        self.register_variable(Float64("u", causality=Fmi3Causality.input))
        self.register_variable(Float64("y", causality=Fmi3Causality.output))
        self.register_variable(Int64("n", causality=Fmi3Causality.output))

    def do_step(self, t, dt):
        self.y += self.u * dt
        self.time, self.n = t + dt, self.n + 1
        return True
"""


def made(folder, module, *arguments):
    run = subprocess.run([sys.executable, "-m", module, *arguments], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def ours(archive, *arguments, preload=False):
    """The columns that `fmu simulate` writes, as texts."""
    environment = dict(os.environ)
    if preload:
        library = Path(sysconfig.get_config_var("LIBDIR")) / sysconfig.get_config_var("INSTSONAME")
        environment["LD_PRELOAD"] = str(library)
        environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path.endswith("site-packages"))
    command = [COMMAND, "simulate", str(archive), "--stop", str(STOP), "--step", str(STEP), "--csv", "-", *arguments]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    rows = list(csv.reader(run.stdout.splitlines()))
    return {name: column for name, column in zip(rows[0], zip(*rows[1:]))}


def compared(archive, outputs, *arguments, preload=False, **more):
    """Every number of both is equal to the last bit."""
    found = ours(archive, *arguments, preload=preload)
    theirs = simulate_fmu(archive, stop_time=STOP, step_size=STEP, output_interval=STEP, output=outputs, validate=False, **more)
    assert len(theirs) == len(found["time"]) == STOP / STEP + 1
    for name in outputs:
        kind = int if np.issubdtype(theirs[name].dtype, np.integer) else float
        mine = [kind(x) for x in found[name]]
        assert mine == [kind(x) for x in theirs[name]], name
    return found


def shared_python():
    name = sysconfig.get_config_var("INSTSONAME") or ""
    return ".so" in name and (Path(sysconfig.get_config_var("LIBDIR")) / name).exists()


u = np.array([(0.0, 1.0), (STOP, 1.0)], dtype=[("time", float), ("u", float)])


@pytest.mark.skipif(not shared_python(), reason="this Python has no shared library, which an FMU of PythonFMU links")
def test_pythonfmu(tmp_path):
    (tmp_path / "counter.py").write_text(INTEGRATOR)
    made(tmp_path, "pythonfmu", "build", "-f", "counter.py")
    found = compared(tmp_path / "Counter.fmu", ["y", "n", "on"], "--set", "u=1", preload=True, input=u)
    assert found["y"][-1] == "2" and found["n"][-1] == "16" and found["text"][-1] == "step 15, done"


@pytest.mark.skipif(not shared_python(), reason="this Python has no shared library, which an FMU of pythonfmu3 links")
def test_pythonfmu3(tmp_path):
    (tmp_path / "counter3.py").write_text(INTEGRATOR3)
    made(tmp_path, "pythonfmu3", "build", "-f", "counter3.py")
    found = compared(tmp_path / "Counter3.fmu", ["y", "n"], "--set", "u=1", preload=True, input=u)
    assert found["y"][-1] == "2" and found["n"][1] == "9007199254740993"


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_fmucontainer(fmi, archives, tmp_path):
    for name in ("PmsmPlant.fmu", "SensorlessController.fmu"):
        copy(archives / f"fmi{fmi}" / name, tmp_path)
    links = [("SensorlessController", f"u_{x}", "PmsmPlant", f"u_{x}") for x in "abc"]
    links += [("PmsmPlant", f"i_{x}", "SensorlessController", f"i_{x}") for x in "abc"]
    lines = ["rule;from_fmu;from_port;to_fmu;to_port", "FMU;PmsmPlant.fmu;;;", "FMU;SensorlessController.fmu;;;"]
    lines += [f"LINK;{a}.fmu;{x};{b}.fmu;{y}" for a, x, b, y in links]
    lines += [
        "INPUT;;speed_ref;SensorlessController.fmu;speed_ref",
        "OUTPUT;PmsmPlant.fmu;speed;;speed",
        "OUTPUT;PmsmPlant.fmu;i_a;;i_a",
    ]
    (tmp_path / "pair.csv").write_text("\n".join(lines) + "\n")
    step = ["-container", f"pair.csv:{STEP / 1250}", "-no-auto-link", "-fmu-directory", ".", "-fmi", fmi]
    made(tmp_path, "fmu_manipulation_toolbox.cli.fmucontainer", *step)
    start = {"speed_ref": 50.0}
    found = compared(tmp_path / "pair.fmu", ["speed", "i_a"], "--set", "speed_ref=50", start_values=start)
    assert max(float(x) for x in found["speed"]) > 10.0
