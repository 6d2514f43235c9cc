"""Losses and temperatures of the packed drive: one operating point of a traction machine, and its thermal network.

The machine is gym-electric-motor's default (DOI 10.1109/TPEL.2020.3006779) at 400 V; the loss parameters and the
thermal network are assumed. The figures are an independent calculation with the closed forms of the inverter and of the
network.
"""

import numpy as np
import pytest
from fmpy import simulate_fmu

from pair import Unit
from scenarios import RPM

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
CONSTANT, NETWORK, IMPOSED = 1, 2, 3
SPEED = 3000.0 * RPM
# For 80 N.m at the shaft: the currents with the lowest copper loss, and the torque before iron loss and friction.
I_D, I_Q = -92.549, 126.193
TORQUE = 4.5 * (66e-3 + (1.2e-3 - 0.37e-3) * -I_D) * I_Q
LOSSES = {"p_cu": 661.23, "p_iron": 264.18, "p_cond": 322.67, "p_sw": 249.07, "p_friction": 120.19}
MACHINE = {"n_p": 3, "R_s": 18e-3, "L_d": 0.37e-3, "L_q": 1.2e-3, "psi_M": 66e-3}
DRIVE = {
    **{f"{part}.motor.{name}": value for part in ("plant", "controller") for name, value in MACHINE.items()},
    "plant.mechanics.imposed": True,
    "plant.iron.G_e": 3e-3,
    "plant.iron.G_h": 5.0,
    "controller.estimator": 13,  # Sensored
    "controller.speed_loop.torque_mode": True,
    "controller.current.mtpa": True,
    "controller.current.active_resistance": True,  # settles within milliseconds
    "controller.limit.i": 400.0,
    "controller.limit.i_q": 400.0,
    "controller.limit.tau": 1000.0,
    # The figures are those of sinusoidal currents; with 0.1 ms, their ripple adds 0.3 % to the copper loss.
    "controller.T_s": 2e-5,
    "u_dc": 400.0,
}
INVERTER = {
    "u_transistor": 0.8,
    "r_transistor": 2.2e-3,
    "u_diode": 0.9,
    "r_diode": 1.6e-3,
    "E_sw": 25e-3,
    "i_sw": 300.0,
    "u_sw": 400.0,
}
FRICTION = {"B": 2e-4, "tau_coulomb": 0.3, "k_w": 2e-7}
NONE = {f"plant.mechanics.{name}": 0.0 for name in FRICTION}


def drive(archives, standard, stop, interval, start, output):
    """The drive on a shaft that turns at 3000 rpm."""
    names = ("time", "speed_shaft", "angle_shaft", "tau_ref")
    rows = [(0.0, SPEED, 0.0, TORQUE), (stop, SPEED, SPEED * stop, TORQUE)]
    return simulate_fmu(
        archives / f"fmi{standard}" / "PmsmDrive.fmu",
        stop_time=stop,
        output_interval=interval,
        input=np.array(rows, dtype=[(name, float) for name in names]),
        start_values=DRIVE | start,
        output=output,
    )


@STANDARDS
def test_loss_split(archives, standard):
    start = {f"plant.inverter.{name}": value for name, value in INVERTER.items()}
    start |= {f"plant.mechanics.{name}": value for name, value in FRICTION.items()}
    energies = ["energy_in", "energy_mech", "energy_loss"]
    output = [*LOSSES, *energies, "tau_shaft", "efficiency", "Q_coolant"]
    result = drive(archives, standard, 0.12, 1e-4, start, output)
    # Three periods of the currents.
    late = result[-201:]
    for name, watt in LOSSES.items():
        assert late[name][1:].mean() == pytest.approx(watt, rel=5e-4), name
    p_in, p_mech, p_loss = ((late[name][-1] - late[name][0]) / 0.02 for name in energies)
    assert p_in == pytest.approx(26750.08, rel=2e-4)
    assert p_mech / p_in == pytest.approx(0.93954, abs=1e-4)
    assert late["tau_shaft"].mean() == pytest.approx(80.0, rel=2e-4)
    assert p_loss == pytest.approx(sum(LOSSES.values()), rel=5e-4)
    assert p_in == pytest.approx(p_mech + p_loss, rel=1e-5)
    assert late["efficiency"][1:].mean() == pytest.approx(0.93954, abs=1e-4)
    # Without a network, the coolant takes all losses.
    assert late["Q_coolant"][-1] == pytest.approx(sum(late[name][-1] for name in LOSSES), rel=1e-12)


@STANDARDS
def test_steady_temperatures(archives, standard):
    """The coolant at 65 degC, capacities a thousandth: 10 s are 10 000 s, twelve times the longest time constant."""
    network = {"C_winding": 2.5, "C_stator": 12.0, "C_rotor": 6.0, "C_inverter": 0.5}
    network |= {"G_ws": 60.0, "G_sc": 150.0, "G_sr": 8.0, "G_inverter": 20.0, "T_start": 338.15}
    start = {f"plant.thermal.{name}": value for name, value in network.items()}
    start |= {"plant.thermal.mode": NETWORK, "plant.winding.alpha": 3.93e-3, "T_coolant": 338.15} | NONE
    parts = ["Q_winding", "Q_iron", "Q_magnet", "Q_inverter"]
    output = ["T_winding", "T_stator", "T_magnet", "T_inverter", "p_cu", "Q_coolant", *parts]
    result = drive(archives, standard, 10.0, 1e-2, start, output)
    for name, celsius in (("T_winding", 86.204), ("T_stator", 72.316), ("T_magnet", 75.619), ("T_inverter", 65.0)):
        assert result[name][-1] - 273.15 == pytest.approx(celsius, abs=0.01), name
    # With the resistance the copper loss grows, and all heat arrives at the coolant.
    assert result["p_cu"][-1] == pytest.approx(833.27, rel=5e-4)
    assert result["Q_coolant"][-1] == pytest.approx(sum(result[name][-1] for name in parts), rel=1e-3)


@STANDARDS
def test_temperatures_are_part_of_the_state(archives, standard):
    """Stored in the middle of a warm-up and restored: the same bits."""
    names = ("C_winding", "C_stator", "C_rotor", "C_inverter", "G_ws", "G_sc", "G_sr", "G_inverter")
    parameters = dict(zip((f"thermal.{name}" for name in names), (0.15, 0.9, 0.25, 0.1, 2.0, 1.2, 0.3, 5.0)))
    parameters |= {"winding.alpha": 3.93e-3, "magnet.alpha": -1.1e-3, "iron.G_e": 1e-4, "initial.speed": 100.0}
    plant = Unit(archives / f"fmi{standard}" / "PmsmPlant.fmu", parameters, {"thermal.mode": NETWORK})
    slave, out = plant.slave, plant.of("T_winding", "T_stator", "T_magnet", "i_d", "i_q", "speed")
    plant.set_reals(plant.of("u_a", "u_b", "u_c"), [20.0, -10.0, -10.0])

    def run(first):
        for k in range(first, first + 100):
            slave.doStep(k * 1e-4, 1e-4)
        return plant.get_reals(out)

    middle = run(0)
    if plant.fmi2:
        state = slave.getFMUstate()
        stored = slave.serializeFMUstate(state)
    else:
        state = slave.getFMUState()
        stored = slave.serializeFMUState(state)
    end = run(100)
    assert end[0] > middle[0] + 0.1 > 293.3
    if plant.fmi2:
        slave.setFMUstate(slave.deSerializeFMUstate(stored))
    else:
        slave.setFMUState(slave.deserializeFMUState(stored))
    assert plant.get_reals(out) == middle
    assert run(100) == end
    plant.close()


@STANDARDS
def test_model_exchange(archives, standard):
    """Imposed temperatures act as in Co-Simulation; the network is refused, with advice."""
    start = {"plant.winding.alpha": 3.93e-3, "plant.magnet.alpha": -1.1e-3, "controller.estimator": 13, "speed_ref": 50.0}
    start |= {"T_winding_imposed": 393.15, "T_magnet_imposed": 353.15, "plant.thermal.mode": IMPOSED}
    output = ["T_winding", "T_magnet", "Q_coolant", "i_d", "i_q", "tau_e", "speed"]

    def run(start, **arguments):
        archive = archives / f"fmi{standard}" / "PmsmDrive.fmu"
        return simulate_fmu(
            archive, stop_time=0.1, output_interval=1e-3, start_values=start, output=output, **arguments
        )

    exchange = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-9, "record_events": False}
    exchanged, stepped = run(start, **exchange), run(start)
    for name in output:
        assert exchanged[name][-1] == pytest.approx(stepped[name][-1], abs=1e-5), name
    assert exchanged["T_winding"][-1] == 393.15
    # The magnets give 0.934 of the torque per ampere.
    torque = 4.5 * 0.15 * 0.934 * exchanged["i_q"]
    assert exchanged["tau_e"] == pytest.approx(torque, abs=1e-9)
    assert exchanged["speed"][-1] > 40.0

    said = []
    start |= {f"plant.thermal.C_{part}": 1.0 for part in ("winding", "stator", "rotor", "inverter")}
    with pytest.raises(Exception, match=r"."):
        run(
            start | {"plant.thermal.mode": NETWORK},
            debug_logging=True,
            logger=lambda *arguments: said.append(str(arguments[-1])),
            **exchange,
        )
    assert any("plant.thermal.mode = 2 (Network) is not allowed" in text and "Co-Simulation" in text for text in said)
