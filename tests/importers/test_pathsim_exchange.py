"""PathSim integrates the template of an FMU of one's own, RcCircuit, in Model Exchange; the motor FMUs do not run there.

pathsim-fmi passes every port as a real number, and PmsmPlant and PmsmDrive have Boolean ports; it reads the first time event
before it updates the discrete states, before the FMU has returned it, so a sampled FMU would stand still.
`FMU_OWN` is the folder with RcCircuit.fmu of both standards.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from pathsim import Connection, Simulation
from pathsim.blocks import Constant, Scope
from pathsim.solvers import RKDP54
from pathsim_fmi import ModelExchangeFMU

STANDARDS = pytest.mark.parametrize("standard", ["fmi2", "fmi3"])


@STANDARDS
def test_rc_circuit(standard):
    """5 V through 2 kOhm onto 1 mF: u_c = 5 V (1 - exp(-t / 2 s))."""
    rc = ModelExchangeFMU(str(Path(os.environ["FMU_OWN"]) / standard / "RcCircuit.fmu"), start_values={"R": 2000.0})
    source, scope = Constant(5.0), Scope()
    links = [Connection(source[0], rc["u"]), Connection(rc["u_c"], scope[0])]
    simulation = Simulation(
        [source, rc, scope], links, dt=1e-2, Solver=RKDP54, tolerance_lte_abs=1e-10, tolerance_lte_rel=1e-9, log=False
    )
    simulation.run(5.0)
    time, (u_c,) = scope.read()
    assert time[-1] == pytest.approx(5.0)
    assert np.abs(u_c - 5.0 * (1.0 - np.exp(-np.asarray(time) / 2.0))).max() < 1e-8


@STANDARDS
@pytest.mark.parametrize("name", ["PmsmPlant", "SensorlessController", "PmsmDrive"])
def test_motor_fmus_do_not_run(standard, name):
    """Should this fail some day, PathSim has learned it: tell docs/import.md."""
    with pytest.raises(Exception, match=r".+"):
        fmu = ModelExchangeFMU(str(Path(os.environ["FMU_ARCHIVES"]) / standard / f"{name}.fmu"))
        simulation = Simulation([fmu], [], dt=1e-3, Solver=RKDP54, log=False)
        simulation.run(1e-3)
        assert fmu.time_event is not None, "the first time event was never asked for"
