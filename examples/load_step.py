"""Load step of 2 N.m at standstill (Rasmussen 2006, Fig. 5a/c/e): plant and controller FMU, stepped with FMPy.

    cargo run --release -- build
    pip install fmpy matplotlib
    python examples/load_step.py target/fmu/fmi3        (or target/fmu/fmi2)
"""

import sys
from math import degrees, pi, remainder

import matplotlib.pyplot as plt
from fmpy import extract, instantiate_fmu, read_model_description

T_S, STOP = 1e-4, 3.0  # s: the controller's sample period, the end of the run


def start(folder, name):
    """Return an initialized instance, its getter and its setter by variable name."""
    archive = f"{folder}/{name}.fmu"
    description = read_model_description(archive)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmu = instantiate_fmu(extract(archive), description, fmi_type="CoSimulation")
    if description.fmiVersion == "2.0":
        fmu.setupExperiment(startTime=0.0, stopTime=STOP)
        fmu.enterInitializationMode()
        read, write = fmu.getReal, fmu.setReal
    else:
        fmu.enterInitializationMode(startTime=0.0, stopTime=STOP)
        read, write = fmu.getFloat64, fmu.setFloat64
    fmu.exitInitializationMode()
    return fmu, lambda *names: read([reference[n] for n in names]), lambda names, values: write([reference[n] for n in names], values)


folder = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi3"
plant, get_plant, set_plant = start(folder, "PmsmPlant")
controller, get_controller, set_controller = start(folder, "SensorlessController")

rows = []
for k in range(round(STOP / T_S)):
    t = k * T_S
    i_a, i_b, i_c, speed, theta = get_plant("i_a", "i_b", "i_c", "speed", "theta_e")  # all outputs ...
    u_a, u_b, u_c, i_d, i_q, theta_hat = get_controller("u_a", "u_b", "u_c", "i_d", "i_q", "theta_est")
    set_plant(["u_a", "u_b", "u_c", "tau_load"], [u_a, u_b, u_c, 2.0 if t >= 0.5 else 0.0])  # ... then all inputs ...
    set_controller(["i_a", "i_b", "i_c", "speed_ref"], [i_a, i_b, i_c, 0.0])
    plant.doStep(currentCommunicationPoint=t, communicationStepSize=T_S)  # ... then both step
    controller.doStep(currentCommunicationPoint=t, communicationStepSize=T_S)
    rows.append((t, speed * 30 / pi, i_d, i_q, degrees(remainder(theta_hat - theta, 2 * pi))))

for fmu in (plant, controller):
    fmu.terminate()
    fmu.freeInstance()
t, speed, i_d, i_q, error = zip(*rows)
print(f"dip {min(speed):.1f} rpm; at the end {speed[-1]:.2f} rpm, i_sd {i_d[-1]:.3f} A, i_sq {i_q[-1]:.3f} A, angle error {error[-1]:.2f} deg")
figure, axes = plt.subplots(3, sharex=True, figsize=(7, 7))
for axis, label, curves in zip(axes, ("speed [rpm]", "current [A]", "angle error [deg]"), ([speed], [i_d, i_q], [error])):
    for curve in curves:
        axis.plot(t, curve)
    axis.set_ylabel(label)
axes[1].legend(["i_sd", "i_sq"])
axes[2].set_xlabel("t [s]")
figure.savefig("load_step.png", dpi=120)
