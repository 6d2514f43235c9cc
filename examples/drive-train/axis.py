"""A feed axis of a machine tool: a servo drive in a position loop, the same script with PmsmDrive or PmsmDriveMean.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/drive-train/axis.py target/fmu/fmi3/PmsmDriveMean.fmu
    python examples/drive-train/axis.py target/fmu/fmi3/PmsmDrive.fmu target/fmu/fmi3/PmsmDriveMean.fmu --plot axis.svg

A ball screw moves a table: rapid travel, a cut against a force, rapid travel back. The numerical control sets the speed
reference every millisecond from position error and speed of the profile; --stop 1 ends earlier.
"""

from pathlib import Path

import numpy as np
from drives import ENERGIES, Fmu, arguments, compare, plot, power, tuned

H = 1e-3  # s
PITCH, MASS, FRICTION = 0.02 / (2 * np.pi), 400.0, 250.0  # m/rad, kg, N: assumed
SCREW = 4e-3  # kg.m2 with the coupling: assumed
GAIN = 40.0  # 1/s, of the position loop
OUTPUTS = ["angle", "speed", "tau_e", *ENERGIES]
# Moves: distance in m, speed in m/s, acceleration in m/s2, cutting force in N, and rest afterwards in s.
MOVES = [(0.40, 0.6, 2.5, 0.0, 0.1), (0.15, 0.1, 1.0, 2500.0, 0.2), (-0.55, 0.6, 2.5, 0.0, 0.3)]
VALUES = tuned("servo-6.6kw")
# An encoder instead of the sensorless start, and the inertia of screw and table with that of the rotor.
VALUES |= {"controller.estimator": 13, "controller.zero_speed.i_0": 0.0, "controller.speed_loop.bandwidth": 250.0}
J = float(VALUES["plant.mechanics.J"]) + SCREW + MASS * PITCH**2
VALUES |= {"plant.mechanics.J": J, "controller.mechanics.J": J}
# Losses of iron and inverter: assumed.
VALUES |= {"plant.iron.G_e": 3e-4, "plant.iron.G_h": 0.1, "plant.inverter.E_sw": 2e-3, "plant.inverter.i_sw": 20.0}
VALUES |= {f"plant.inverter.{name}": 0.9 for name in ("u_transistor", "u_diode")} | {"plant.inverter.u_sw": 600.0}
VALUES |= {f"plant.inverter.{name}": 0.03 for name in ("r_transistor", "r_diode")}


def risen(s):
    """Share of the speed at the share s of its rise, in which the acceleration is a pulse sin^2."""
    s = s.clip(0.0, 1.0)
    return s - np.sin(2 * np.pi * s) / (2 * np.pi)


def profile():
    """Position (m), speed (m/s) and cutting force (N) at each step."""
    x, v, force, start = [], [], [], 0.0
    for distance, most, acceleration, cut, rest in MOVES:
        sign, distance = np.sign(distance), abs(distance)
        rise = 2.0 * most / acceleration  # the mean of the pulse is half of its peak
        whole = rise + distance / most
        t = H * np.arange(round((whole + rest) / H))
        speed = sign * most * (risen(t / rise) - risen((t - whole + rise) / rise))
        x.append(start + np.cumsum(speed) * H - speed * H)
        v.append(speed)
        force.append(np.where(np.abs(speed) > 0.99 * most, cut, 0.0))
        start = x[-1][-1] + speed[-1] * H
    return np.concatenate(x), np.concatenate(v), np.concatenate(force)


def run(file, stop):
    """The moves with a drive: its outputs over time."""
    drive = Fmu(file, VALUES, ["speed_ref", "tau_load"], OUTPUTS)
    x, v, force = (values[: round(stop / H) if stop else None] for values in profile())
    rows, angle, speed = [], 0.0, 0.0
    for wanted, feed, cut in zip(x, v, force):
        # Friction of the guides with the sign of the speed, without a jump at 0.
        load = PITCH * (FRICTION * np.tanh(speed * PITCH / 0.002) + cut)
        row = drive.step(H, (feed + GAIN * (wanted - angle * PITCH)) / PITCH, load)
        angle, speed = row[0], row[1]
        rows.append(row)
    drive.close()
    return {"time": H * np.arange(len(x)), "wanted": x + v * H, **dict(zip(OUTPUTS, np.array(rows).T))}


def energies(run):
    """Energies in J: all, drawn from the link and returned to it, at the shaft, and lost in the drive."""
    p_in = power(run) * H
    link, shaft, lost = (run[name][-1] for name in ENERGIES)
    return {"link": link, "drawn": p_in.clip(min=0).sum(), "returned": p_in.clip(max=0).sum(), "shaft": shaft, "lost": lost}


def error(run):
    """Following error in mm."""
    return 1e3 * (run["wanted"] - run["angle"] * PITCH)


def panels(run):
    return {
        "position [mm]": 1e3 * run["angle"] * PITCH,
        "following error [mm]": error(run),
        "torque [N.m]": run["tau_e"],
        "link power [kW]": 1e-3 * power(run),
    }


def main():
    drives, stop, file = arguments(__doc__)
    runs = {Path(drive).stem: run(drive, stop) for drive in drives}
    compare(runs, energies)
    for name, one in runs.items():
        most, torque = np.abs(error(one)).max(), np.abs(one["tau_e"]).max()
        print(f"{name}: following error up to {most:.3f} mm, torque up to {torque:.1f} N.m")
    if file:
        plot(file, runs, panels)


main()
