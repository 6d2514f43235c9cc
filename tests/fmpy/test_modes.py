"""Brake, coast and limits, and a start in a loaded steady state, from the packed FMUs: docs/modes.md."""

import numpy as np
import pytest
from fmpy import simulate_fmu

TORQUE = "controller.speed_loop.torque_mode"


def series(t, **columns):
    """Input signals at the instants `t` as FMPy takes them."""
    types = [("time", float)] + [(name, bool if isinstance(c[0], bool) else float) for name, c in columns.items()]
    return np.array(list(zip(t, *columns.values())), dtype=types)


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
@pytest.mark.parametrize("name", ["PmsmDrive", "PmsmDriveMean"])
def test_a_drive_begins_at_its_operating_point(archives, standard, name):
    """The reference machine at 100 rad/s under 2 N.m, in Co-Simulation and in Model Exchange: nothing moves."""
    start = {"plant.initial.speed": 100.0, "initial.steady": 2, "speed_ref": 100.0, "tau_load": 2.0, "u_dc": 325.0}
    outputs = ["speed", "tau_e", "i_q", "p_in", "speed_est"]
    for kind in ("CoSimulation", "ModelExchange"):
        result = simulate_fmu(archives / standard / f"{name}.fmu", fmi_type=kind, start_values=start, stop_time=0.3, output_interval=1e-3,
                              output=outputs, relative_tolerance=1e-8)  # fmt: skip
        for output in outputs[:1] + outputs[-1:]:
            assert np.abs(result[output] / 100.0 - 1.0).max() < 2e-4, (kind, output)
        assert result["tau_e"][0] == pytest.approx(2.0, rel=0.1), kind
        assert result["i_q"].std() < 0.02 * result["i_q"].mean(), kind


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
@pytest.mark.parametrize("name", ["PmsmDrive", "PmsmDriveMean"])
def test_brake_coast_and_limits(archives, standard, name):
    """Torque control within 80 rad/s and 3 N.m, a brake of 1 N.m to standstill, and a shaft that coasts."""
    start = {TORQUE: True, "controller.limit.speed_use": True, "controller.limit.speed_max": 80.0, "controller.limit.tau_use": True,
             "tau_ref": 4.0, "tau_limit_max": 3.0, "tau_limit_min": -3.0, "controller.brake.tau": 1.0, "u_dc": 325.0}  # fmt: skip
    t = [0.0, 1.0, 1.0, 2.0, 2.0, 3.0]
    signals = series(t, brake=[False, False, True, True, False, False], coast=[False, False, False, False, True, True])
    result = simulate_fmu(archives / standard / f"{name}.fmu", fmi_type="CoSimulation", start_values=start, input=signals, stop_time=3.0,
                          output_interval=1e-3, output=["speed", "tau_e", "tau_max", "tau_min"])  # fmt: skip

    def at(time, output):
        return result[output][np.searchsorted(result["time"], time)]

    assert result["tau_e"].max() == pytest.approx(3.0, abs=0.15)
    assert at(0.9, "speed") == pytest.approx(80.0, abs=0.2)
    assert at(0.9, "tau_max") == pytest.approx(3.0, abs=1e-9)
    assert at(1.02, "tau_e") == pytest.approx(-1.0, abs=0.05)
    assert at(1.02, "tau_min") == pytest.approx(-1.0, abs=1e-9)
    assert abs(at(1.9, "speed")) < 0.1
    coasts = result["time"] > 2.1
    assert np.abs(result["tau_e"][coasts]).max() < 0.01
