"""fmucontainer packs the pair into one FMU, which FMPy runs: with Jacobi exchange, and one FMU after the other.

With -sequential the plant, named first, is stepped first, and the controller samples the currents at the end of that very
step: its command acts in the next step, which is `timing.delay` = 0.
"""

import subprocess
import sys
from shutil import copy

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from reference import LINKS, NAMES, RECORDED, T_S

ORDERS = {"jacobi": [], "plant first": ["-sequential"]}


def container(archives, experiment, order, folder):
    """Makes the container; returns its file."""
    file = {instance: f"{name}.fmu" for instance, name in NAMES.items()}
    for name in file.values():
        copy(archives / "fmi2" / name, folder)
    lines = ["rule;from_fmu;from_port;to_fmu;to_port", *(f"FMU;{name};;;" for name in file.values())]
    lines += [f"LINK;{file[a]};{x};{file[b]};{y}" for a, x, b, y in LINKS]
    lines += [f"INPUT;;{x};{file[a]};{x}" for a, x in (("controller", "speed_ref"), ("plant", "tau_load"))]
    lines += [f"OUTPUT;{file[a]};{x};;{x}" for a, x in RECORDED]
    lines += [f"START;{file['plant']};initial.theta_e;{experiment.theta_e!r};"]
    lines += [f"START;{file['controller']};timing.delay;{experiment.delay(order)};"]
    (folder / "pair.csv").write_text("\n".join(lines) + "\n")
    tool = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmucontainer"]
    arguments = ["-container", f"pair.csv:{T_S}", "-no-auto-link", "-fmu-directory", ".", *ORDERS[order]]
    made = subprocess.run([*tool, *arguments], cwd=folder, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder / "pair.fmu"


@pytest.mark.parametrize("order", ORDERS)
def test_pair(archives, experiment, order, tmp_path):
    archive = container(archives, experiment, order, tmp_path)
    description = read_model_description(archive, validate=False)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    identifier = description.coSimulation.modelIdentifier
    fmu = FMU2Slave(guid=description.guid, unzipDirectory=extract(archive), modelIdentifier=identifier, instanceName="pair")
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    inputs, outputs = [reference[x] for x in ("speed_ref", "tau_load")], [reference[x] for _, x in RECORDED]
    rows = []
    for k in range(experiment.steps):
        if k % experiment.every == 0:
            rows.append(fmu.getReal(outputs))
        fmu.setReal(inputs, [experiment.speed_ref(k), experiment.load(k)])
        fmu.doStep(currentCommunicationPoint=k * T_S, communicationStepSize=T_S)
    fmu.terminate()
    fmu.freeInstance()
    experiment.check(rows, order)
