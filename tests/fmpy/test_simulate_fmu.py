"""FMPy's own `simulate_fmu` on each archive alone: results that need no second FMU."""

import numpy as np
import pytest
from fmpy import simulate_fmu

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
OPTIONS = [{}, {"early_return_allowed": True}, {"set_stop_time": False}, {"record_events": False}]


def plant(archives, standard, **arguments):
    """Direct current through phase a, with the rotor aligned: it does not turn."""
    return simulate_fmu(
        archives / f"fmi{standard}" / "PmsmPlant.fmu",
        stop_time=0.05,
        step_size=1e-4,
        output_interval=1e-4,
        start_values={"u_a": 10.0, "u_b": -5.0, "u_c": -5.0, **arguments.pop("start_values", {})},
        output=["i_a", "i_b", "i_c", "i_d", "i_q", "speed", "angle", "tau_e"],
        **arguments,
    )


@STANDARDS
@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: next(iter(options), "plain"))
def test_plant_at_direct_voltage(archives, standard, options):
    result = plant(archives, standard, **options)
    expected = 5.0 * (1.0 - np.exp(-result["time"] * 2.0 / 6e-3))  # u/R (1 - exp(-t R/L))
    assert result["time"][-1] == pytest.approx(0.05)
    assert np.abs(result["i_a"] - expected).max() < 1e-5
    assert np.abs(result["i_d"] - expected).max() < 1e-5
    assert np.abs(result["i_b"] + expected / 2).max() < 1e-5
    assert np.abs(result["i_c"] + expected / 2).max() < 1e-5
    for still in ("i_q", "speed", "angle", "tau_e"):
        assert np.abs(result[still]).max() < 1e-9, still


@STANDARDS
def test_start_values_reach_the_plant(archives, standard):
    result = plant(archives, standard, start_values={"motor.R_s": 4.0, "initial.speed": 1.0, "motor.n_p": 2})
    assert result["speed"][0] == 1.0
    assert result["i_d"][-1] < 3.0


@STANDARDS
def test_inputs_over_time(archives, standard):
    """A load torque from t = 10 ms on, read from an input table: speed falls at tau / J."""
    table = np.array([(0.0, 0.0), (0.01, 0.0), (0.01, 1.0), (0.03, 1.0)], dtype=[("time", float), ("tau_load", float)])
    quiet = {"u_a": 0.0, "u_b": 0.0, "u_c": 0.0, "mechanics.tau_coulomb": 0.0, "mechanics.B": 0.0, "motor.psi_M": 1e-9}
    result = simulate_fmu(
        archives / f"fmi{standard}" / "PmsmPlant.fmu",
        stop_time=0.03,
        step_size=1e-4,
        output_interval=1e-4,
        start_values=quiet,
        input=table,
        output=["speed"],
    )
    assert np.abs(result["speed"][result["time"] < 0.01]).max() < 1e-12
    assert result["speed"][-1] == pytest.approx(-0.02 / 1.5e-3, rel=0.01)


@STANDARDS
@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: next(iter(options), "plain"))
def test_controller_without_a_machine(archives, standard, options):
    """No current ever flows: the command rises to the corner of the hexagon that lies on phase a, and no further."""
    result = simulate_fmu(
        archives / f"fmi{standard}" / "SensorlessController.fmu",
        stop_time=0.5,
        step_size=1e-4,
        output_interval=1e-4,
        output=["u_a", "u_b", "u_c", "i_d_ref", "speed_est", "theta_est"],
        **options,
    )
    between = result["u_a"] - result["u_b"]
    assert between[0] == 0.0
    assert between[-1] == pytest.approx(325.0, abs=1e-6)
    assert between.max() < 325.0 + 1e-9
    assert result["i_d_ref"][0] == 0.0
    assert result["i_d_ref"][-1] == pytest.approx(5.0)
    assert np.abs(result["theta_est"]).max() < 1e-9


def test_both_standards_agree(archives):
    assert plant(archives, 2).tobytes() == plant(archives, 3).tobytes()


@STANDARDS
@pytest.mark.parametrize("step", [1e-4, 1e-3, 3.7e-5])
def test_power_and_energy_of_the_drive_are_balanced(archives, standard, step):
    """To 1000 rpm in 1 s and 2 N.m: the energies balance to 1e-6, the mean powers to 0.1 %, and each is the other's integral."""
    rpm, out = np.pi / 30.0, ["speed", "i_d", "i_q", "voltage_limited", "current_limited"]
    powers = ["p_in", "p_mech", "p_loss"]
    energies = ["energy_in", "energy_mech", "energy_loss"]
    names = [("time", float), ("speed_ref", float), ("tau_load", float)]
    table = np.array([(0.0, 0.0, 0.0), (1.0, 1000 * rpm, 0.0), (1.5, 1000 * rpm, 2.0), (2.5, 1000 * rpm, 2.0)], dtype=names)
    result = simulate_fmu(
        archives / f"fmi{standard}" / "PmsmDrive.fmu",
        stop_time=2.5,
        step_size=step,
        output_interval=step,
        input=table,
        output=out + powers + energies,
    )
    stored = 0.75 * 6e-3 * (result["i_d"] ** 2 + result["i_q"] ** 2) + 0.5 * 1.5e-3 * result["speed"] ** 2
    balance = result["energy_in"] - result["energy_mech"] - result["energy_loss"] - (stored - stored[0])
    assert result["energy_in"][-1] > 200.0
    assert np.abs(balance).max() < 1e-6 * result["energy_in"][-1]
    steady = result["time"] > 2.0
    p_in, p_mech, p_loss = (result[name][steady].mean() for name in powers)
    assert abs(p_in - p_mech - p_loss) < 1e-3 * p_in
    seconds = result["time"][steady][-1] - result["time"][steady][0]
    for power, energy in zip(powers, energies):
        passed = result[energy][steady]
        assert (passed[-1] - passed[0]) / seconds == pytest.approx(result[power][steady].mean(), rel=1e-3)
    assert not result["voltage_limited"][steady].any() and not result["current_limited"][steady].any()
