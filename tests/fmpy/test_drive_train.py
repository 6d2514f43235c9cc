"""PmsmDrive with a load behind a torsional spring: which communication step the two ways of coupling allow (docs/import.md).

A compliant shaft: the rotor turns inside the FMU, the torque of the spring is `tau_load`. Held over h, it gives the
map of rotor angle and speed over a step the determinant 1 - d h / J + c h^2 / 2J, which is below 1 for h < 2 d / c. An imposed
shaft: the rotor belongs to the train, which gets `tau_shaft`. The drive starts to 1000 rpm and gets 1 N.m; the train is
integrated exactly between the communication points.
"""

import numpy as np
import pytest
from fmpy import extract, instantiate_fmu, read_model_description

J = 1.5e-3  # kg.m2: rotor, the start value of plant.mechanics.J
# Stiffness in N.m/rad, damping in N.m.s/rad, inertia of the load in kg.m2.
SOFT, STIFF, STIFFER = (50.0, 0.05, 1.5e-3), (500.0, 0.2, 2e-3), (5000.0, 2.0, 5e-3)
MS = 1e-3


def exponential(a):
    """exp(a) of a matrix: a series at a 1024th of it."""
    term = result = np.eye(len(a))
    for k in range(1, 12):
        term = term @ a / 1024.0 / k
        result = result + term
    return np.linalg.matrix_power(result, 1024)


class Train:
    """The states outside the FMU, followed by the values held over a step."""

    def __init__(self, train, imposed, h):
        self.c, self.d, load = train
        self.imposed = imposed
        # Rotor angle and speed, load angle and speed, torques of drive and load. The FMU's rotor continues at its
        # speed.
        a = np.zeros((6, 6))
        a[0, 1] = a[2, 3] = 1.0
        a[3] = [self.c / load, self.d / load, -self.c / load, -self.d / load, 0.0, -1.0 / load]
        if imposed:
            a[1] = [-self.c / J, -self.d / J, self.c / J, self.d / J, 1.0 / J, 0.0]
        self.x, self.step = np.zeros(6), exponential(a * h)

    def torque(self):
        return self.c * (self.x[0] - self.x[2]) + self.d * (self.x[1] - self.x[3])


def run(folder, train, imposed, h, stop=1.4):
    """The speed of the load at each communication point; ends where the coupling has diverged."""
    description = read_model_description(folder)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmu = instantiate_fmu(folder, description, fmi_type="CoSimulation")
    three = description.fmiVersion != "2.0"
    read, write = (fmu.getFloat64, fmu.setFloat64) if three else (fmu.getReal, fmu.setReal)
    fmu.setBoolean([reference["plant.mechanics.imposed"]], [imposed])
    if not three:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    outside, speed = Train(train, imposed, h), []
    get, put = (["tau_shaft"], ["angle_shaft", "speed_shaft"]) if imposed else (["angle", "speed"], ["tau_load"])
    for k in range(round(stop / h)):
        speed_ref, load = (104.72 if k * h >= 0.1 - 1e-9 else 0.0), (1.0 if k * h >= 0.8 - 1e-9 else 0.0)
        got = read([reference[name] for name in get])
        if imposed:
            given = outside.x[:2]
            outside.x[4] = got[0]
        else:
            outside.x[:2] = got
            given = [outside.torque()]
        outside.x[5] = load
        speed.append(outside.x[3])
        try:
            write([reference[name] for name in ["speed_ref", *put]], [speed_ref, *given])
            fmu.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)
        except Exception:  # the FMU refuses the values of a diverging coupling
            break
        outside.x = outside.step @ outside.x
        if abs(outside.x[3]) > 1e3:
            break
    fmu.freeInstance()
    return np.array(speed)


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
@pytest.mark.parametrize(("train", "imposed", "h", "off"), [
    (SOFT, False, 1 * MS, 1.0), (SOFT, False, 2 * MS, 3.0), (SOFT, False, 5 * MS, None),
    (SOFT, True, 2 * MS, 4.0),
    (STIFF, False, 0.5 * MS, 1.2), (STIFF, False, 2 * MS, None),
    (STIFF, True, 2 * MS, 3.5), (STIFF, True, 10 * MS, 13.0),
    (STIFFER, False, 0.5 * MS, 10.0), (STIFFER, False, 1 * MS, None),
    (STIFFER, True, 2 * MS, 1.5), (STIFFER, True, 10 * MS, 7.0),
])  # fmt: skip
def test_communication_step(archives, standard, train, imposed, h, off, reference_runs):
    folder, exact = reference_runs(archives, standard, train)
    speed = run(folder, train, imposed, h)
    if off is None:
        assert abs(speed[-1] - 104.72) > 50.0 or len(speed) < round(1.4 / h), "the coupling does not diverge"
        return
    every = round(h / (0.1 * MS))
    difference = np.abs(speed - exact[::every][: len(speed)]).max()
    print(f"{standard} {train} {'imposed' if imposed else 'compliant'} {h / MS} ms: {difference:.2f} rad/s off")
    assert len(speed) == round(1.4 / h) and difference < off
    assert np.abs(speed[-round(0.1 / h) :] - 104.72).max() < 0.2


@pytest.fixture(scope="session")
def reference_runs():
    """The folder of an unpacked drive, and the run with an imposed shaft at 0.1 ms."""
    folders, runs = {}, {}

    def find(archives, standard, train):
        if standard not in folders:
            folders[standard] = extract(archives / standard / "PmsmDrive.fmu")
        if (standard, train) not in runs:
            runs[standard, train] = run(folders[standard], train, True, 0.1 * MS)
        return folders[standard], runs[standard, train]

    return find
