"""A pump that restarts after a brown-out: the voltage sags, the drive trips, and catches the turning pump when the voltage returns.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/drive-train/brownout.py target/fmu/fmi3/PmsmDrive.fmu
    python examples/drive-train/brownout.py target/fmu/fmi3/PmsmDrive.fmu --plot brownout.svg

The run begins at the operating point of the pump (`initial.steady`). Below 380 V the gates are off until 480 V are back; the load
follows the affinity laws.
"""

from pathlib import Path

import numpy as np
from drives import ENERGIES, RPM, Fmu, arguments, compare, plot, tuned

H = 1e-3  # s
RATED, TORQUE = 1500 * RPM, 11.0  # rad/s, N.m: assumed
SPEED = 0.9 * RATED
OUTPUTS = ["speed", "tau_e", *ENERGIES]
VALUES = tuned("ipmsm-2.2kw")
J = float(VALUES["plant.mechanics.J"]) + 0.02  # with impeller and water
VALUES |= {"plant.mechanics.J": J, "controller.mechanics.J": J, "controller.speed_loop.ramp": 100.0}
VALUES |= {"initial.steady": 2, "plant.initial.speed": SPEED, "speed_ref": SPEED, "tau_load": 0.81 * TORQUE, "u_dc": 540.0}
VALUES |= {"controller.start.catch": True, "controller.trip.use": True, "controller.trip.i": 30.0, "controller.trip.u_dc": 700.0}
VALUES |= {"controller.trip.u_dc_min": 380.0, "controller.trip.u_dc_restart": 480.0}


def voltage(t):
    """Voltage of the link in V: a sag of 0.4 s."""
    return 540.0 if t < 0.5 or t >= 0.9 else 300.0


def run(file, stop):
    """The sag with a drive: its outputs over time."""
    drive = Fmu(file, VALUES, ["tau_load", "u_dc"], OUTPUTS)
    time = H * np.arange(round((stop or 3.0) / H))
    rows, speed = [], SPEED
    for t in time:
        row = drive.step(H, TORQUE * (speed / RATED) * abs(speed / RATED), voltage(t))
        speed = row[0]
        rows.append(row)
    drive.close()
    return {"time": time, "u_dc": np.array([voltage(t) for t in time]), **dict(zip(OUTPUTS, np.array(rows).T))}


def energies(run):
    """Energies in J: from the link, at the shaft, and lost in the drive."""
    return dict(zip(["link", "shaft", "lost"], (run[name][-1] for name in ENERGIES)))


def panels(run):
    return {"u_dc [V]": run["u_dc"], "speed [rpm]": run["speed"] / RPM, "torque [N.m]": run["tau_e"]}


def main():
    drives, stop, file = arguments(__doc__)
    runs = {Path(drive).stem: run(drive, stop) for drive in drives}
    compare(runs, energies)
    for name, one in runs.items():
        away = one["time"][np.abs(one["speed"] - SPEED) > 0.01 * SPEED]
        print(f"{name}: {SPEED / RPM:.1f} rpm, at least {one['speed'].min() / RPM:.1f} rpm, back after {away[-1] - 0.9:.2f} s, "
              f"{one['tau_e'].min():.2f} to {one['tau_e'].max():.2f} N.m")  # fmt: skip
    if file:
        plot(file, runs, panels)


main()
