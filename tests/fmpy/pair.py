"""Plant and controller in a co-simulation written by hand with FMPy: the loop that every test uses, for copying.

Jacobi exchange: at a communication point all outputs are read, then all inputs set, then both FMUs step. So the currents
of one instant give the voltages that act from the next one on, which is what `timing.delay` = 1 (the start value) means.
"""

from ctypes import byref, c_bool, c_double, c_uint32
from pathlib import Path
from shutil import rmtree

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

RECORDED = {"plant": ("speed", "theta_e"), "controller": ("speed_est", "theta_est", "i_d", "i_q", "u_a")}


class Unit:
    """One FMU: a thin layer over FMPy that makes FMI 2.0 and FMI 3.0 look the same."""

    def __init__(self, archive, parameters=None, integers=None, booleans=None):
        self.description = read_model_description(archive)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmi2 = self.description.fmiVersion == "2.0"
        self.folder = extract(archive)
        self.slave = (FMU2Slave if self.fmi2 else FMU3Slave)(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=Path(archive).stem,
        )
        self.get_reals = self.slave.getReal if self.fmi2 else self.slave.getFloat64
        self.set_reals = self.slave.setReal if self.fmi2 else self.slave.setFloat64
        self.slave.instantiate()
        for name, value in (parameters or {}).items():
            self.set_reals([self.references[name]], [value])
        for name, value in (integers or {}).items():
            self.set_integer(name, value)
        for name, value in (booleans or {}).items():
            self.slave.setBoolean([self.references[name]], [value])
        if self.fmi2:
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def set_integer(self, name, value):
        """Sets an integer or an enumeration; FMI 3.0 has a setter for each."""
        kinds = {v.name: v.type for v in self.description.modelVariables}
        setter = self.slave.setInteger if self.fmi2 else self.slave.setInt64
        if kinds[name] == "Int32":
            setter = self.slave.setInt32
        setter([self.references[name]], [value])

    def of(self, *names):
        """Value references."""
        return [self.references[name] for name in names]

    def _access(self, way, names):
        """FMPy's call for these real variables, its arguments and their values."""
        n = len(names)
        references, values = (c_uint32 * n)(*self.of(*names)), (c_double * n)()
        call = getattr(self.slave, f"fmi2{way}Real" if self.fmi2 else f"fmi3{way}Float64")
        return call, (self.slave.component, references, n, values, *(() if self.fmi2 else (n,))), values

    def reader(self, *names):
        """A function that gets these real variables: `get_reals` with arrays that are made once."""
        call, arguments, values = self._access("Get", names)

        def read():
            call(*arguments)
            return values[:]

        return read

    def writer(self, *names):
        """A function that sets these real variables: `set_reals` with arrays that are made once."""
        call, arguments, values = self._access("Set", names)

        def write(*new):
            values[:] = new
            call(*arguments)

        return write

    def stepper(self, h):
        """A function that steps by `h` (s) from a time: `doStep` with arguments that are made once."""
        it, slave = self.slave.component, self.slave
        if self.fmi2:
            return lambda t: slave.fmi2DoStep(it, t, h, 1)
        flags, reached = (c_bool(), c_bool(), c_bool()), c_double()
        places = *map(byref, flags), byref(reached)

        def step(t):
            slave.fmi3DoStep(it, t, h, True, *places)
            assert not any(flag.value for flag in flags), f"event, end or early return at {t} s"

        return step

    def close(self):
        """Ends the simulation and removes the unpacked files."""
        self.slave.terminate()
        self.slave.freeInstance()
        rmtree(self.folder, ignore_errors=True)


def simulate(folder, scenario, h):
    """Runs a scenario with plant and controller from the archives of `folder`, in steps of `h` (s).

    Returns the recorded outputs over time, in SI units, at communication points that are sample instants.
    """
    plant = Unit(f"{folder}/PmsmPlant.fmu", scenario.plant)
    controller = Unit(f"{folder}/SensorlessController.fmu", scenario.controller)
    currents, voltages = ("i_a", "i_b", "i_c"), ("u_a", "u_b", "u_c")
    from_plant = plant.reader(*currents, *RECORDED["plant"])
    from_controller = controller.reader(*voltages, *RECORDED["controller"])
    to_plant, to_controller = plant.writer(*voltages, "tau_load"), controller.writer(*currents, "speed_ref")
    step_plant, step_controller = plant.stepper(h), controller.stepper(h)

    every = max(1, round(scenario.T_s / h))  # between its samples the controller holds theta_est
    rows = []
    for k in range(round(scenario.duration / h) + 1):
        t = k * h
        i_abc_and_more = from_plant()
        u_abc_and_more = from_controller()
        if k % every == 0:
            rows.append((t, *i_abc_and_more[3:], *u_abc_and_more[3:]))
        to_plant(*u_abc_and_more[:3], scenario.load(t))
        to_controller(*i_abc_and_more[:3], scenario.speed_ref(t))
        step_plant(t)
        step_controller(t)
    plant.close()
    controller.close()
    names = ("t", *RECORDED["plant"], *RECORDED["controller"])
    return dict(zip(names, np.array(rows).T))
