"""A vehicle on a driving cycle: the same script with PmsmDrive, PmsmDriveMean or a map.

    cargo run --release -- build
    cargo run --release -- map motors/traction-100kw.toml --out target/map
    pip install fmpy matplotlib
    python examples/drive-train/vehicle.py target/fmu/fmi3/PmsmDriveMean.fmu
    python examples/drive-train/vehicle.py target/fmu/fmi3/PmsmDrive.fmu target/fmu/fmi3/PmsmDriveMean.fmu \
        target/map/map.npz --plot vehicle.svg                  # compares them; --stop 60 ends earlier

The driver requests torque; the drive delivers torque at its shaft, which moves the vehicle. The vehicle imposes
its speed on the shaft in return. Vehicle and cycle are those of examples/vehicle.
"""

import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
from drives import ENERGIES, HERE, LOSSES, RPM, Fmu, arguments, compare, plot, power, tuned

H = 2e-2  # s
OUTPUTS = ["tau_shaft", *ENERGIES, *LOSSES]
VALUES = tuned("traction-100kw")
# Torque control with a resolver instead of the sensorless start, on the shaft of the vehicle. The current is the only limit.
VALUES |= {"controller.estimator": 13, "controller.start.mode": 1, "controller.speed_loop.torque_mode": True}
VALUES |= {"plant.mechanics.imposed": True, "controller.emf.hold_reversal": False, "controller.limit.tau": 1e3}

CAR = tomllib.loads((HERE.parent / "vehicle/vehicle.toml").read_text())
TIME, SPEED = np.genfromtxt(HERE.parent / "vehicle/cycle.csv", delimiter=",", skip_header=2, unpack=True)
RATIO = CAR["gear_ratio"] / CAR["wheel_radius"]  # rad/s of the machine per m/s
MASS = CAR["mass"] + float(VALUES["plant.mechanics.J"]) * RATIO**2


def cell(axis, at):
    """The cell of a grid, and the position in it from 0 to 1."""
    k = min(np.searchsorted(axis, at, "right"), len(axis) - 1) - 1
    return k, (at - axis[k]) / (axis[k + 1] - axis[k])


class Map:
    """A drive by the map of `fmu map`: torque at the shaft without delay, losses by bilinear interpolation.

    The map's torque axis is the share x of the limit at that speed, so no cell crosses the envelope. The losses in W
    are interpolated, never the efficiency, which is 0/0 without load.
    """

    def __init__(self, file):
        data = np.load(file)
        self.speed, self.x = data["speed"], data["x"]
        self.limits = [data[name][0, 0] for name in ("tau_min", "tau_max")]
        self.losses = np.stack([data[name][0, 0] for name in LOSSES], axis=-1)  # over speed and x
        self.energy = np.zeros(3)

    def step(self, h, speed, angle, tau_ref):
        low, high = (np.interp(speed, self.speed, limit) for limit in self.limits)
        tau = min(max(tau_ref, low), high)
        x = tau / (high if tau > 0.0 else -low)
        (k, a), (n, b) = cell(self.speed, speed), cell(self.x, x)
        low_speed, high_speed = (1 - b) * self.losses[k : k + 2, n] + b * self.losses[k : k + 2, n + 1]
        losses = (1 - a) * low_speed + a * high_speed
        self.energy += h * np.array([tau * speed + losses.sum(), tau * speed, losses.sum()])
        return [tau, *self.energy, *losses]

    def close(self):
        pass


def resistance(v):
    """Force in N at the speed v in m/s."""
    rolling = CAR["rolling_resistance"] * CAR["mass"] * 9.81 if v > 0.0 else 0.0
    return rolling + 0.5 * CAR["air_density"] * CAR["drag_area"] * v**2


def run(file, stop):
    """The cycle with a drive: its outputs over time, and the speed in m/s."""
    inputs = ["speed_shaft", "angle_shaft", "tau_ref"]
    drive = Map(file) if file.endswith(".npz") else Fmu(file, VALUES, inputs, OUTPUTS)
    time = H * np.arange(round((stop or TIME[-1]) / H) + 1)
    wanted = np.interp(time, TIME, SPEED / 3.6)
    rows, v, angle, integral = [], 0.0, 0.0, 0.0
    for now, then in pairwise(wanted):
        # The driver: the force for the wanted acceleration, and a PI controller of the speed; the brakes hold the vehicle.
        held = now == then == 0.0
        integral = 0.0 if held else integral + 800.0 * (now - v) * H
        force = 0.0 if held else MASS * (then - now) / H + resistance(now) + 3000.0 * (now - v) + integral
        row = drive.step(H, v * RATIO, angle, force / RATIO)
        rows.append([v, *row])
        angle += v * RATIO * H
        v = 0.0 if held else max(v + H * (row[0] * RATIO - resistance(v)) / MASS, 0.0)
    drive.close()
    return {"time": time[:-1], "wanted": wanted[:-1], **dict(zip(["v", *OUTPUTS], np.array(rows).T))}


def energies(run):
    """Energies in J: all, drawn from the link and returned to it, and the losses."""
    p_in = power(run) * H
    row = {"link": run["energy_in"][-1], "drawn": p_in.clip(min=0).sum(), "returned": p_in.clip(max=0).sum()}
    return row | {name: run[name].sum() * H for name in LOSSES}


def panels(run):
    return {
        "speed [km/h]": 3.6 * run["v"],
        "torque [N.m]": run["tau_shaft"],
        "link power [kW]": 1e-3 * power(run),
        "losses [kW]": 1e-3 * power(run, "energy_loss"),
    }


def main():
    drives, stop, file = arguments(__doc__)
    runs = {Path(drive).stem: run(drive, stop) for drive in drives}
    compare(runs, energies)
    for name, one in runs.items():
        error, most = 3.6 * np.abs(one["v"] - one["wanted"]).max(), one["v"].max() * RATIO / RPM
        print(f"{name}: speed within {error:.2f} km/h, up to {most:.0f} rpm")
    if file:
        plot(file, runs, panels)


main()
