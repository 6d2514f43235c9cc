"""A small scooter with a hub motor and no sensor: torque from the grip, a speed limit, a brake that holds on a slope, and rolling on.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/drive-train/scooter.py target/fmu/fmi3/PmsmDrive.fmu
    python examples/drive-train/scooter.py target/fmu/fmi3/PmsmDrive.fmu --plot scooter.svg

The motor has the wheel and 12 kg of the vehicle on its shaft; the load is a slope of 6 % between 4 and 9 s.
"""

from pathlib import Path

import numpy as np
from drives import ENERGIES, RPM, Fmu, arguments, compare, plot, tuned

H = 1e-3  # s
RADIUS, MASS = 0.08, 12.0  # m, kg
LIMIT = 200 * RPM
OUTPUTS = ["speed", "tau_e", "p_in", *ENERGIES]
VALUES = tuned("hub-36v")
VALUES |= {"controller.speed_loop.torque_mode": True, "u_dc": 36.0}
VALUES |= {"controller.limit.speed_use": True, "controller.limit.speed_max": LIMIT, "controller.limit.speed_min": -0.2 * LIMIT}
VALUES |= {"controller.brake.tau": 2.5, "controller.zero_speed.release": True, "controller.zero_speed.by_need": True}


def ride(t):
    """Torque of the grip in N.m, the brake and the coasting at the time t (s)."""
    return (3.0 if 1.0 <= t < 5.0 or 9.0 <= t < 10.0 else 0.0), 5.0 <= t < 9.0, t >= 10.0


def slope(t):
    """Load of the slope in N.m."""
    return 0.06 * MASS * 9.81 * RADIUS if 4.0 <= t < 9.0 else 0.0


def run(file, stop):
    """The ride with a drive: its outputs over time."""
    drive = Fmu(file, VALUES, ["tau_ref", "tau_load"], OUTPUTS)
    time = H * np.arange(round((stop or 12.0) / H))
    rows = []
    for t in time:
        tau, brake, coast = ride(t)
        drive.switch(brake=brake, coast=coast)
        rows.append(drive.step(H, tau, slope(t)))
    drive.close()
    return {"time": time, **dict(zip(OUTPUTS, np.array(rows).T))}


def energies(run):
    """Energies in J: from the link, at the shaft, and lost in the drive."""
    return dict(zip(["link", "shaft", "lost"], (run[name][-1] for name in ENERGIES)))


def panels(run):
    return {"speed [rpm]": run["speed"] / RPM, "torque [N.m]": run["tau_e"], "power [W]": run["p_in"]}


def main():
    drives, stop, file = arguments(__doc__)
    runs = {Path(drive).stem: run(drive, stop) for drive in drives}
    compare(runs, energies)
    for name, one in runs.items():
        holds, speed = (one["time"] > 7.0) & (one["time"] < 9.0), one["speed"] / RPM
        print(f"{name}: at most {speed.max():.2f} rpm, holds the slope within {np.abs(speed[holds]).max():.3f} rpm "
              f"with {one['p_in'][holds].mean():.2f} W, ends at {speed[-1]:.2f} rpm")  # fmt: skip
    if file:
        plot(file, runs, panels)


main()
