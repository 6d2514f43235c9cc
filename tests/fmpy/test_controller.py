"""One sample of the controller alone: tests what a closed loop would hide behind its integrators."""

import numpy as np
import pytest

from pair import Unit

T_S, SENSORED = 1e-4, 13
L, PSI_M, N_P, BANDWIDTH = 6e-3, 0.15, 3, 2 * np.pi * 250.0
NAMES = ("u_a", "u_b", "u_c", "i_d", "i_q", "i_d_ref", "i_q_ref", "theta_est", "speed_est")


def first_sample(archive, delay, speed, theta, i_dq=0j):
    """Outputs that sample 0 gives, with angle and speed from a sensor."""
    unit = Unit(archive, {}, {"timing.delay": delay, "estimator": SENSORED})
    phases = (i_dq * np.exp(1j * (theta - 2 * np.pi / 3 * np.arange(3)))).real
    values = {"theta_meas": theta, "speed_meas": speed, "speed_ref": speed, **dict(zip(("i_a", "i_b", "i_c"), phases))}
    unit.set_reals(unit.of(*values), list(values.values()))
    before = unit.get_reals(unit.of("u_a", "u_b", "u_c"))
    unit.slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=T_S)
    found = dict(zip(NAMES, unit.get_reals(unit.of(*NAMES))))
    unit.close()
    assert before == [0.0, 0.0, 0.0], "0 V before the first command"
    return found


@pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("rpm", [-1500.0, 300.0, 1500.0])
@pytest.mark.parametrize("theta", [0.0, 2.5])
def test_the_command_is_turned_to_where_it_acts(archives, standard, delay, rpm, theta):
    """PI and feed-forward in the rotor frame, turned by theta + (delay + 1/2) T_s w: the middle of the interval."""
    speed = rpm * np.pi / 30
    w, i = N_P * speed, 0.4 - 0.3j
    out = first_sample(archives / f"fmi{standard}" / "SensorlessController.fmu", delay, speed, theta, i)
    assert (out["i_d"], out["i_q"]) == pytest.approx((i.real, i.imag), abs=1e-12)
    reference = complex(out["i_d_ref"], out["i_q_ref"])
    wanted = BANDWIDTH * L * (reference - i) + 1j * w * (L * i + PSI_M)
    assert abs(wanted) < 160.0, "inside the hexagon"
    command = 2 / 3 * sum(out[f"u_{x}"] * np.exp(2j * np.pi / 3 * k) for k, x in enumerate("abc"))
    expected = wanted * np.exp(1j * (theta + (delay + 0.5) * T_S * w))
    assert abs(command - expected) < 1e-9 * abs(expected)


@pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
def test_the_estimate_is_for_the_end_of_the_sample(archives, standard):
    """theta^[k] + T_s w^[k], and the speed of sample k."""
    out = first_sample(archives / f"fmi{standard}" / "SensorlessController.fmu", 1, 100.0, 0.7)
    assert out["theta_est"] == pytest.approx(0.7 + T_S * N_P * 100.0, abs=1e-12)
    assert out["speed_est"] == pytest.approx(100.0, abs=1e-12)
