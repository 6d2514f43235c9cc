"""Speed, torque, power and efficiency of PmsmDrive in FMPy: to 1000 rpm, a load of 2 N.m, then a driving load.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/drive.py target/fmu/fmi3        (or target/fmu/fmi2; writes drive.svg)
"""

import sys
from contextlib import redirect_stdout

import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

folder = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi3"

# Time in s, speed reference in rad/s, load in N.m: straight lines between the rows, a step where two rows have the same time.
w = 1000 * np.pi / 30
rows = [(0, 0, 0), (0.1, 0, 0), (0.1, w, 0), (0.5, w, 0), (0.6, w, 2), (1, w, 2), (1.2, w, -2), (1.5, w, -2)]
inputs = np.array(rows, dtype=[("time", float), ("speed_ref", float), ("tau_load", float)])
# Losses of iron (S) and inverter (Ohm, J), assumed: the start values are 0.
losses = {"iron.G_e": 1.3e-4, "inverter.r_transistor": 0.08, "inverter.r_diode": 0.08, "inverter.E_sw": 5e-4}
outputs = ["speed", "speed_est", "tau_e", "p_in", "p_mech", "p_loss", "efficiency"]
with redirect_stdout(None):  # FMPy lists the inputs that keep their start values
    run = simulate_fmu(f"{folder}/PmsmDrive.fmu", stop_time=1.5, step_size=1e-3, output_interval=2e-3, input=inputs,
                       output=outputs, start_values={f"plant.{name}": value for name, value in losses.items()})

t, rpm = run["time"], 30 / np.pi
efficiency = np.where(run["efficiency"] > 0, 100 * run["efficiency"], np.nan)  # 0 where no power goes through
panels = {
    "speed [rpm]": {"speed": rpm * run["speed"], "speed_est": rpm * run["speed_est"]},
    "torque [N.m]": {"tau_e": run["tau_e"]},
    "power [W]": {name: run[name] for name in ("p_in", "p_mech", "p_loss")},
    "efficiency [%]": {"efficiency": efficiency},
}
plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "drive", "path.simplify_threshold": 0.3})
figure, axes = plt.subplots(4, sharex=True, figsize=(8, 8), layout="constrained")
axes[3].set_xlabel("time [s]")
for axis, (label, curves) in zip(axes, panels.items()):
    for name, values in curves.items():
        axis.plot(t, values, label=name)
    axis.set_ylabel(label)
    axis.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    axis.grid(alpha=0.3)

for name, k in (("motor", 475), ("generator", 725)):
    speed, p_in, p_mech = (run[name][k] for name in ("speed", "p_in", "p_mech"))
    print(f"{name} at {rpm * speed:.1f} rpm: {p_in:.1f} W in, {p_mech:.1f} W out, efficiency {efficiency[k]:.1f} %")
figure.savefig("drive.svg")
