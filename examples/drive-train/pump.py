"""A centrifugal pump by the hour: speed control without a sensor, the same script with PmsmDrive or PmsmDriveMean.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/drive-train/pump.py target/fmu/fmi3/PmsmDriveMean.fmu
    python examples/drive-train/pump.py target/fmu/fmi3/PmsmDrive.fmu target/fmu/fmi3/PmsmDriveMean.fmu --plot pump.svg

The load follows the affinity laws on a circuit without static head: flow by speed, torque by its square. The demand changes
every 20 s; --stop 60 ends earlier.
"""

from pathlib import Path

import numpy as np
from drives import ENERGIES, RPM, Fmu, arguments, compare, plot, power, tuned

H = 2e-2  # s
RATED, TORQUE, FLOW, HEAD = 1500 * RPM, 11.0, 30 / 3600, 16.0  # rad/s, N.m, m3/s, m: assumed
WATER = 1000 * 9.81  # N/m3
DEMAND = [0.0, 0.6, 0.6, 0.8, 1.0, 0.9, 0.5, 0.4, 0.0]  # share of the flow, every 20 s
OUTPUTS = ["speed", "tau_e", *ENERGIES]
VALUES = tuned("ipmsm-2.2kw")
# Impeller and water on the shaft, and losses that the machine's file lacks: assumed.
J = float(VALUES["plant.mechanics.J"]) + 0.02
VALUES |= {"plant.mechanics.J": J, "controller.mechanics.J": J, "controller.speed_loop.ramp": 40.0}
VALUES |= {"plant.iron.G_e": 2.7e-4, "plant.iron.G_h": 0.127, "plant.inverter.E_sw": 2.5e-3, "plant.inverter.i_sw": 15.0}
VALUES |= {f"plant.inverter.{name}": 0.9 for name in ("u_transistor", "u_diode")} | {"plant.inverter.u_sw": 600.0}
VALUES |= {f"plant.inverter.{name}": 0.06 for name in ("r_transistor", "r_diode")}


def run(file, stop):
    """The demand with a drive: its outputs over time."""
    drive = Fmu(file, VALUES, ["speed_ref", "tau_load"], OUTPUTS)
    time = H * np.arange(round((stop or 20.0 * len(DEMAND)) / H))
    rows, speed = [], 0.0
    for t in time:
        demand = DEMAND[int(t // 20.0)]
        drive.switch(enable=demand > 0.0)  # without demand, the gates are off and the pump coasts
        row = drive.step(H, RATED * demand, TORQUE * (speed / RATED) * abs(speed / RATED))
        speed = row[0]
        rows.append(row)
    drive.close()
    return {"time": time, **dict(zip(OUTPUTS, np.array(rows).T))}


def flow(run):
    """Flow in m3/s."""
    return FLOW * (run["speed"] / RATED).clip(min=0.0)


def energies(run):
    """Energies in J: from the link, at the shaft, in the water, and lost in the drive."""
    water = WATER * HEAD * flow(run) * (run["speed"] / RATED) ** 2
    link, shaft, lost = (run[name][-1] for name in ENERGIES)
    return {"link": link, "shaft": shaft, "water": water.sum() * H, "lost": lost}


def panels(run):
    return {
        "speed [rpm]": run["speed"] / RPM,
        "torque [N.m]": run["tau_e"],
        "link power [kW]": 1e-3 * power(run),
        "flow [m3/h]": 3600 * flow(run),
    }


def main():
    drives, stop, file = arguments(__doc__)
    runs = {Path(drive).stem: run(drive, stop) for drive in drives}
    compare(runs, energies)
    for name, one in runs.items():
        volume = flow(one).sum() * H
        print(f"{name}: {volume:.3f} m3, {one['energy_in'][-1] / volume / 3600:.2f} Wh per m3")
    if file:
        plot(file, runs, panels)


main()
