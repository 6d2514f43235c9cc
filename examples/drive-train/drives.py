"""Shared code of the examples: a drive FMU of FMI 2.0 or 3.0 in a loop written by hand, its tuned parameters, and a plot."""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from shutil import rmtree

import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.simulation import apply_start_values

HERE = Path(__file__).parent
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
RPM = np.pi / 30
LOSSES = ["p_cu", "p_iron", "p_cond", "p_sw", "p_friction"]
ENERGIES = ["energy_in", "energy_mech", "energy_loss"]


def tuned(machine):
    """The values for PmsmDrive and PmsmDriveMean of `fmu tune motors/MACHINE.toml --integers --out examples/drive-train`.

    For the vehicle with --estimator Sensored --control torque --shaft imposed: a resolver, torque control and the full current
    limit, on the shaft of the vehicle.
    """
    root = ET.parse(HERE / f"{machine}.PmsmDrive.ssv").getroot()
    return {one.get("name"): one[0].get("value") for one in root.iter(f"{SSV}Parameter")}


class Fmu:
    """A drive: `step` sets the inputs, steps by h (s) and returns the outputs, all in the order of their names."""

    def __init__(self, file, values, inputs, outputs):
        self.folder = extract(file)
        description = read_model_description(self.folder)
        self.fmu = instantiate_fmu(self.folder, description, fmi_type="CoSimulation")
        left = apply_start_values(self.fmu, description, values)
        assert not left, f"{file} has no {', '.join(left)}"
        real = "Real" if description.fmiVersion == "2.0" else "Float64"
        self.set, self.get = getattr(self.fmu, f"set{real}"), getattr(self.fmu, f"get{real}")
        reference = {v.name: v.valueReference for v in description.modelVariables}
        self.inputs, self.outputs = [[reference[name] for name in names] for names in (inputs, outputs)]
        self.reference = reference
        if description.fmiVersion == "2.0":
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.steps = 0

    def step(self, h, *inputs):
        self.set(self.inputs, inputs)
        self.fmu.doStep(currentCommunicationPoint=self.steps * h, communicationStepSize=h)
        self.steps += 1
        return self.get(self.outputs)

    def switch(self, **switches):
        """Boolean inputs by their names, from the next step on: `enable` for the gates."""
        self.fmu.setBoolean([self.reference[name] for name in switches], list(map(bool, switches.values())))

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()
        rmtree(self.folder, ignore_errors=True)


def power(run, name="energy_in"):
    """Mean power in W over each step, from a counter of the drive: p_in of PmsmDrive is the mean over only its last T_s."""
    return np.diff(run[name], prepend=0.0) / np.diff(run["time"], append=2 * run["time"][-1] - run["time"][-2])


def arguments(usage):
    """The drives, the time at which the run ends (None: all of it) and the file for the plot."""
    drives, stop, plot = [], None, None
    words = iter(sys.argv[1:])
    for word in words:
        if word == "--stop":
            stop = float(next(words))
        elif word == "--plot":
            plot = next(words)
        else:
            drives.append(word)
    if not drives:
        sys.exit(usage)
    return drives, stop, plot


def compare(runs, energies):
    """Prints the energies in kJ of each run, from `energies`, and the deviation of the first energy from that of the first run."""
    table = {name: energies(run) for name, run in runs.items()}
    print(f"{'energy in kJ':<16}" + "".join(f"{title:>12}" for title in next(iter(table.values()))))
    for name, row in table.items():
        print(f"{name:<16}" + "".join(f"{1e-3 * x:12.3f}" for x in row.values()))
    (first, of_first), *others = [(name, next(iter(row.values()))) for name, row in table.items()]
    for name, energy in others:
        print(f"{name} differs from {first} by {100 * (energy / of_first - 1):+.3f} %")


def plot(file, runs, panels):
    """Draws a panel per label with the curves of all runs; `panels` returns {label: values over time} of a run."""
    import matplotlib.pyplot as plt

    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "drive-train", "path.simplify_threshold": 0.5})
    labels = list(panels(next(iter(runs.values()))))
    figure, axes = plt.subplots(len(labels), sharex=True, figsize=(8, 1.8 * len(labels)), layout="constrained")
    for (name, run), style in zip(runs.items(), [("C0", "-", 2.0), ("C1", "--", 1.2), ("black", ":", 1.0)]):
        color, dashes, width = style
        for axis, (label, values) in zip(axes, panels(run).items()):
            every = max(1, len(values) // 1500)
            axis.plot(run["time"][::every], values[::every], dashes, color=color, lw=width, label=name)
            axis.set_ylabel(label)
            axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(file, metadata={"Date": None})
