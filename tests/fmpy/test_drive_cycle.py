"""A vehicle on a drive cycle with the packed drive, and full torque from standstill to far above base speed.

The machine and its losses are those of test_losses_and_temperature.py, vehicle and cycle those of examples/vehicle. A
cascaded torque correction stands for the driver: the drive controls the current, and iron and friction reduce the torque at
the shaft.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pair import Unit
from scenarios import RPM
from test_losses_and_temperature import DRIVE, FRICTION, INVERTER, MACHINE, NETWORK

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
H, KWH, SENSORED = 1e-3, 3.6e6, 13
I_MAX, U_DC, COOLANT = 240.0, 400.0, 338.15
FOLDER = Path(__file__).parents[2] / "examples/vehicle"
# Corners of the cycle: time in s, speed in km/h.
TIME, SPEED = np.genfromtxt(FOLDER / "cycle.csv", delimiter=",", skip_header=2, unpack=True)
VEHICLE = tomllib.loads((FOLDER / "vehicle.toml").read_text())
MASS, ROLLING, DRAG, RHO, WHEEL, GEAR, J_ROTOR = (
    VEHICLE[name]
    for name in (
        "mass", "rolling_resistance", "drag_area", "air_density", "wheel_radius", "gear_ratio", "rotor_inertia"
    )
)
# An independent calculation: steady operating points in the middle of each second, sinusoidal currents. In kWh.
ENERGY, DRAWN, RETURNED = 1.322449, 1.497219, -0.174770
LOSSES = {"p_cu": 0.015373, "p_iron": 0.027246, "p_cond": 0.014992, "p_sw": 0.013319, "p_friction": 0.053891}
CAPACITIES = {"winding": 2500.0, "stator": 12000.0, "rotor": 6000.0, "inverter": 500.0}
CONDUCTANCES = {"ws": 60.0, "sc": 150.0, "sr": 8.0, "inverter": 20.0}

PARAMETERS = {name: value for name, value in DRIVE.items() if isinstance(value, float)}
PARAMETERS |= {f"plant.inverter.{name}": value for name, value in INVERTER.items()}
PARAMETERS |= {f"plant.mechanics.{name}": value for name, value in FRICTION.items()}
PARAMETERS |= {f"plant.thermal.C_{name}": value for name, value in CAPACITIES.items()}
PARAMETERS |= {f"plant.thermal.G_{name}": value for name, value in CONDUCTANCES.items()}
PARAMETERS |= {"controller.T_s": 1e-4, "controller.limit.i": I_MAX, "controller.limit.i_q": I_MAX}
PARAMETERS |= {"u_dc": U_DC, "T_coolant": COOLANT, "plant.thermal.T_start": COOLANT, "controller.zero_speed.i_0": 0.0}
INTEGERS = {"controller.estimator": SENSORED, "plant.thermal.mode": NETWORK}
BOOLEANS = {name: value for name, value in DRIVE.items() if value is True}
BOOLEANS |= {"controller.weakening.use": True, "controller.current.active_resistance": False}


def run(archive, speed, torque, names, correct):
    """Steps the drive on a shaft of this speed (rad/s) with the torque reference (N.m), and returns the outputs."""
    drive = Unit(archive, PARAMETERS, INTEGERS, BOOLEANS)
    write, read, step = drive.writer("speed_shaft", "angle_shaft", "tau_ref"), drive.reader(*names), drive.stepper(H)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * H)])
    rows, more = [], 0.0
    for k, (w, angle_of_shaft, wanted) in enumerate(zip(speed.tolist()[:-1], angle.tolist(), torque.tolist())):
        write(w, angle_of_shaft, wanted + more)
        step(k * H)
        rows.append(row := read())
        if correct:
            more += 0.02 * (wanted - row[0])
    drive.close()
    return dict(zip(names, np.array(rows).T))


def heated(loss, held_for=0.1):
    """Temperatures (K) of winding, stator and rotor at the end, by the exact solution for each tenth of a second."""
    w, s, r = (CAPACITIES[name] for name in ("winding", "stator", "rotor"))
    g_ws, g_sc, g_sr = (CONDUCTANCES[name] for name in ("ws", "sc", "sr"))
    a = np.array([[-g_ws / w, g_ws / w, 0], [g_ws / s, -(g_ws + g_sc + g_sr) / s, g_sr / s], [0, g_sr / r, -g_sr / r]])
    rates, modes = np.linalg.eig(a)
    grows = (modes * np.exp(rates * held_for)) @ np.linalg.inv(modes)
    held = np.linalg.solve(a, grows - np.eye(3))
    power = {name: p.reshape(-1, round(held_for / H)).mean(axis=1) for name, p in loss.items()}
    heat = np.array([power["p_cu"] / w, (0.9 * power["p_iron"] + power["p_friction"]) / s, 0.1 * power["p_iron"] / r])
    above = np.zeros(3)
    for column in heat.T:
        above = grows @ above + held @ column
    return COOLANT + above


def test_cycle(archives):
    """In FMI 3.0 alone: the bits of both standards are equal, as the hash of their default runs shows."""
    t = np.arange(round(TIME[-1] / H) + 1) * H
    v = np.interp(t, TIME, SPEED / 3.6)
    a = np.append(np.diff(v) / H, 0.0)
    force = MASS * (a + ROLLING * 9.81 * (v > 0.0)) + 0.5 * RHO * DRAG * v**2
    speed = v * GEAR / WHEEL
    torque = force * WHEEL / GEAR + J_ROTOR * a * GEAR / WHEEL
    temperatures = ["T_winding", "T_stator", "T_magnet"]
    names = ["tau_shaft", "p_in", *LOSSES, "energy_in", "energy_mech", "energy_loss", "u_share", *temperatures]
    result = run(archives / "fmi3" / "PmsmDrive.fmu", speed, torque, names, correct=True)

    assert speed.max() > 3.3 * 3075.0 * RPM  # base speed
    assert result["u_share"].max() < 0.96
    assert np.sqrt(np.mean((result["tau_shaft"] - torque[:-1]) ** 2)) < 0.1
    p_in = result["p_in"] * H / KWH
    assert result["energy_in"][-1] / KWH == pytest.approx(ENERGY, rel=1e-3)
    assert p_in.clip(min=0.0).sum() == pytest.approx(DRAWN, rel=1e-3)
    assert p_in.clip(max=0.0).sum() == pytest.approx(RETURNED, rel=2e-3)
    # A voltage that is held for 0.1 ms while the rotor turns by x = 0.33 rad has the fundamental sin(x/2) / (x/2), 0.4 %
    # less: field weakening goes that much deeper, which moves iron loss to copper and inverter.
    for name, energy in LOSSES.items():
        assert result[name].sum() * H / KWH == pytest.approx(energy, rel=0.01), name
    assert result["p_friction"].sum() * H / KWH == pytest.approx(LOSSES["p_friction"], rel=1e-4)
    # No current flows at either end: nothing is stored.
    balance = result["energy_in"][-1] - result["energy_mech"][-1] - result["energy_loss"][-1]
    assert abs(balance) < 1e-7 * (DRAWN - RETURNED) * KWH
    expected = heated({name: result[name] for name in LOSSES})
    assert [result[name][-1] for name in temperatures] == pytest.approx(expected, abs=0.01)
    assert result["T_winding"].max() > COOLANT + 5.0


@STANDARDS
def test_full_torque(archives, standard):
    """On a ramp to 12000 rpm in 12 s, the torque is the maximum that current and voltage allow."""
    speed = np.linspace(500.0, 12000.0, 12001) * RPM
    names = ["tau_e", "tau_max"]
    archive = archives / f"fmi{standard}" / "PmsmDrive.fmu"
    result = run(archive, speed, np.full(len(speed), 500.0), names, correct=False)
    n_p, r, l_d, l_q, psi = (MACHINE[name] for name in ("n_p", "R_s", "L_d", "L_q", "psi_M"))
    # Currents on the limit circle, from the minimum current at full torque onwards.
    angle = np.linspace(0.0, 0.5 * np.pi, 20001)
    i_d, i_q = -I_MAX * np.sin(angle), I_MAX * np.cos(angle)
    tau = 1.5 * n_p * (psi - (l_q - l_d) * i_d) * i_q
    for k in range(200, 12000, 200):
        w = n_p * 0.5 * (speed[k] + speed[k + 1])
        u = np.hypot(r * i_d - w * l_q * i_q, r * i_q + w * (psi + l_d * i_d))
        limit = tau[u <= 0.95 * U_DC / np.sqrt(3.0)].max()
        assert result["tau_max"][k] == pytest.approx(limit, rel=1e-3)
        assert result["tau_e"][k - 5 : k + 5].mean() == pytest.approx(limit, rel=0.01), speed[k] / RPM
