"""DC link, battery limits, trips, short circuit and loss of the sensor of the packed drive, in both standards and both interfaces.

The figures of the traction machine are closed forms: the voltage of the link in steady state, the current and the torque of
a short circuit.
"""

import numpy as np
import pytest
from fmpy import simulate_fmu

from scenarios import RPM

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
INTERFACES = pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
N_P, R_S, L_D, L_Q, PSI_M = 3, 18e-3, 0.37e-3, 1.2e-3, 66e-3
MACHINE = {"n_p": N_P, "R_s": R_S, "L_d": L_D, "L_q": L_Q, "psi_M": PSI_M}
SPEED = 3000.0 * RPM
DRIVE = {
    **{f"{part}.motor.{name}": value for part in ("plant", "controller") for name, value in MACHINE.items()},
    "plant.mechanics.imposed": True,
    "controller.estimator": 13,  # Sensored
    "controller.speed_loop.torque_mode": True,
    "controller.current.mtpa": True,
    "controller.current.active_resistance": True,
    "controller.weakening.use": True,
    "controller.limit.i": 240.0,
    "controller.limit.i_q": 240.0,
    "u_dc": 400.0,
}
LINK = {"dc_link.use": True, "dc_link.C": 1e-3, "dc_link.R_source": 0.2}


def drive(archives, standard, interface, start, stop=0.15, tau_ref=80.0, booleans=()):
    """The drive on a shaft that turns at 3000 rpm; `booleans` are inputs as (name, before, after), which change at a third of the run."""
    names = [(name, float) for name in ("time", "speed_shaft", "angle_shaft", "tau_ref")]
    rows = [
        (t, SPEED, SPEED * t, tau_ref, *(before if t < stop / 3 or (t == stop / 3 and first) else after for _, before, after in booleans))
        for t, first in ((0.0, True), (stop / 3, True), (stop / 3, False), (stop, False))
    ]
    return simulate_fmu(
        archives / f"fmi{standard}" / "PmsmDrive.fmu",
        fmi_type=interface,
        stop_time=stop,
        output_interval=1e-3,
        input=np.array(rows, dtype=[*names, *((name, bool) for name, *_ in booleans)]),
        start_values=DRIVE | start,
        output=["tau_e", "i_d", "i_q", "u_cap", "i_source", "i_dc", "p_in_mean", "tau_max", "tripped", "short_circuit", "sensor_lost",
                "energy_source", "energy_resistor", "energy_chopper", "energy_in", "i_cap_rms"],  # fmt: skip
    )


@STANDARDS
@INTERFACES
def test_the_link_sags_as_the_source_says(archives, standard, interface):
    result = drive(archives, standard, interface, LINK)
    power, u = result["p_in_mean"][-1], result["u_cap"][-1]
    assert u == pytest.approx(0.5 * (400.0 + np.sqrt(400.0**2 - 4.0 * 0.2 * power)), rel=5e-4)
    assert result["tau_e"][-1] == pytest.approx(80.0, rel=0.02) and power > 20e3
    assert result["i_source"][-1] == pytest.approx((400.0 - u) / 0.2, rel=1e-2)
    assert 30.0 < result["i_cap_rms"][-1] < 120.0
    stored = 0.5e-3 * (u**2 - 400.0**2)
    lost = result["energy_resistor"][-1] + result["energy_in"][-1] + stored
    assert result["energy_source"][-1] == pytest.approx(lost, rel=1e-3)


@STANDARDS
@INTERFACES
def test_the_chopper_takes_what_the_source_does_not(archives, standard, interface):
    chopper = {"chopper.use": True, "chopper.u_on": 430.0, "chopper.u_off": 420.0, "chopper.R": 4.0, "dc_link.R_source": 2.0}
    result = drive(archives, standard, interface, LINK | chopper, tau_ref=-80.0)
    assert 429.0 < result["u_cap"].max() < 431.0
    assert result["energy_chopper"][-1] > 1000.0
    stored = 0.5e-3 * (result["u_cap"][-1] ** 2 - 400.0**2)
    taken = result["energy_resistor"] + result["energy_chopper"] + result["energy_in"]
    assert result["energy_source"][-1] == pytest.approx(taken[-1] + stored, abs=1e-3 * result["energy_chopper"][-1])


@STANDARDS
@INTERFACES
def test_a_short_circuit_has_the_current_of_the_closed_form(archives, standard, interface):
    result = drive(archives, standard, interface, {}, stop=0.9, booleans=[("asc", False, True)])
    w = N_P * SPEED
    by = PSI_M / (R_S**2 + w**2 * L_D * L_Q)
    i_d, i_q = -(w**2) * L_Q * by, -w * R_S * by
    assert result["short_circuit"][-1]
    assert result["i_d"][-1] == pytest.approx(i_d, rel=1e-3)
    assert result["tau_e"][-1] == pytest.approx(1.5 * N_P * (PSI_M - (L_Q - L_D) * i_d) * i_q, rel=1e-3)


@STANDARDS
def test_a_trip_and_a_lost_sensor_are_told(archives, standard):
    trip = {"controller.trip.use": True, "controller.trip.i": 250.0, "controller.trip.u_dc": 401.0, "controller.trip.asc": True}
    result = drive(archives, standard, "CoSimulation", LINK | trip, tau_ref=-80.0)
    assert result["tripped"][-1] == 3  # OverVoltage
    assert not result["short_circuit"].any()
    fallback = {"controller.sensor.fallback": 4}  # ExtendedEmf
    result = drive(archives, standard, "CoSimulation", fallback, booleans=[("sensor_valid", True, False)])
    assert result["sensor_lost"][-1] and not result["sensor_lost"][10]
    assert result["tau_e"][-1] == pytest.approx(80.0, rel=0.02)


@STANDARDS
@INTERFACES
def test_the_battery_gives_no_more_than_its_limit(archives, standard, interface):
    limits = {"controller.limit.i_dc_use": True, "controller.limit.i_dc_max": 40.0}
    result = drive(archives, standard, interface, limits)
    assert result["p_in_mean"][-20:].mean() / 400.0 == pytest.approx(40.0, rel=0.05)
    assert result["tau_e"][-20:].mean() == pytest.approx(result["tau_max"][-1], rel=0.02)


@STANDARDS
@pytest.mark.parametrize(
    ("start", "refusal"),
    [
        ({"dc_link.use": True, "dc_link.C": 0.0}, "dc_link.C = 0 F"),
        ({**LINK, "chopper.use": True, "chopper.u_off": 395.0, "chopper.u_on": 390.0}, "chopper.u_off = 395 V"),
        ({"controller.trip.use": True, "controller.trip.i": 200.0}, "controller.trip.i = 200 A"),
    ],
)
def test_what_cannot_be_is_refused(archives, standard, start, refusal):
    log = []
    with pytest.raises(Exception):
        simulate_fmu(
            archives / f"fmi{standard}" / "PmsmDrive.fmu",
            stop_time=0.01,
            start_values=DRIVE | start,
            debug_logging=True,
            logger=lambda *arguments: log.append(arguments[-1].decode()),
        )
    assert any(refusal in message for message in log), log
