"""A vehicle on a driving cycle: the drive is an FMU; the vehicle, its brakes and its driver are here."""

import os
import re
import warnings
from itertools import pairwise

import numpy as np

from ._instance import _described, _instance, _kind, _open
from ._simulate import _apply, _no_variable, _start_values

# Outputs that a drive may have, and the cause of each loss.
_CAUSES = {"p_cu": "copper", "p_iron": "iron", "p_cond": "inverter, conduction", "p_sw": "inverter, switching", "p_friction": "friction"}
_TEMPERATURES = ("T_winding", "T_stator", "T_magnet", "T_inverter")
_NEEDED = ("tau_shaft", "energy_in", "energy_mech", "energy_loss", "tau_max", "tau_min")
_INPUTS = ("tau_ref", "speed_shaft", "angle_shaft")
# The drive under a vehicle: torque control on an imposed shaft; with a sensor instead of a sensorless start, the current is the only limit.
_IMPOSED = {"plant.mechanics.imposed": True, "controller.speed_loop.torque_mode": True}
_SENSOR = {"controller.estimator": "Sensored", "controller.start.mode": "Direct", "controller.emf.hold_reversal": False,
           "controller.limit.tau": 1e5}  # fmt: skip


def vehicle(mass, cda, c_rr, radius, gear, *, gear_efficiency=1.0, inertia=0.0, rho=1.2, g=9.81):
    """A vehicle whose wheels one drive turns.

    Args:
        mass: kg
        cda: drag coefficient times frontal area (m2)
        c_rr: rolling resistance as a share of the weight; none at rest
        radius: of the wheel (m)
        gear: turns of the drive per turn of the wheel
        gear_efficiency: of the gear, in both directions
        inertia: of the wheels (kg.m2); that of the rotor is a value of the drive
        rho: density of the air (kg/m3)
        g: acceleration of gravity (m/s2)

    Returns:
        a `Vehicle`, whose `run` drives a cycle

    >>> car = vehicle(1300.0, 0.6, 0.010, 0.30, 9.0)
    >>> round(car.resistance(100 / 3.6))    # N at 100 km/h
    405
    """
    return Vehicle(mass, cda, c_rr, radius, gear, gear_efficiency=gear_efficiency, inertia=inertia, rho=rho, g=g)


class Vehicle:
    """A vehicle, of `vehicle`."""

    def __init__(self, mass, cda, c_rr, radius, gear, *, gear_efficiency=1.0, inertia=0.0, rho=1.2, g=9.81):
        values = {"mass": mass, "cda": cda, "c_rr": c_rr, "radius": radius, "gear": gear, "gear_efficiency": gear_efficiency,
                  "inertia": inertia, "rho": rho, "g": g}  # fmt: skip
        for name, value in values.items():
            above = name in ("mass", "radius", "gear", "gear_efficiency", "g")
            if not np.isfinite(value) or value < 0.0 or (above and value == 0.0):
                raise ValueError(f"{name} = {value!r} must be {'greater than' if above else 'at least'} 0")
        limits = ("c_rr", 0.5, "write 1 % as 0.01"), ("radius", 3.0, "write 300 mm as 0.3"), ("rho", 2.0, "that of air is 1.2 kg/m3")
        for name, most, advice in limits:
            if values[name] > most:
                raise ValueError(f"{name} = {values[name]!r} must be at most {most}: {advice}")
        if mass < 10.0 * cda:
            raise ValueError(f"mass = {mass!r} must be at least 10 kg for each m2 of cda = {cda!r}: write 1.3 t as 1300")
        if gear_efficiency > 1.0:
            raise ValueError(f"gear_efficiency = {gear_efficiency!r} must be at most 1: write 97 % as 0.97")
        self.mass, self.cda, self.c_rr, self.radius, self.gear = mass, cda, c_rr, radius, gear
        self.gear_efficiency, self.inertia, self.rho, self.g = gear_efficiency, inertia, rho, g

    def resistance(self, v):
        """Force (N) of air and rolling at the speed v (m/s) on a level road."""
        air, rolling = self._resistances(v, 0.0)[:2]
        return air + rolling

    def _resistances(self, v, slope):
        """Forces (N) of air, rolling and slope (a ratio) at the speed v (m/s)."""
        cosine = 1.0 / np.sqrt(1.0 + slope * slope)
        weight = self.mass * self.g * cosine
        return 0.5 * self.rho * self.cda * v * v, self.c_rr * weight if v > 0.0 else 0.0, weight * slope

    def run(self, fmu, cycle, *, start_values=None, slope=0.0, driver=(2.3, 0.6), sensor=True, step_size=0.02, stop_time=None,
            outputs=()):  # fmt: skip
        """Drive a cycle; returns a `Trip`.

        The driver requests the torque of the wanted acceleration and of the resistances, and a PI controller of the speed corrects
        it. Below the minimum torque of the drive, the brakes of the vehicle take the rest.

        Args:
            fmu: PmsmDrive, PmsmDriveMean or MappedDrive, or a preset of one
            cycle: a CSV file with time (s), speed (km/h, or the unit of a header such as speed [m/s]) and, as a third column, slope (%);
                or an array of such rows. Straight lines connect them
            start_values: of the FMU, as those of `drives.tune`; they are completed by torque control on an imposed shaft
            slope: of the road (%), constant or rows of (distance in m, slope), if the cycle has none
            driver: gains of the PI controller in 1/s and 1/s2, times the mass
            sensor: the drive has a sensor at its shaft and no limit other than its current and voltage; False: as in start_values
            step_size: of vehicle and drive (s)
            stop_time: end earlier (s)
            outputs: more variables of the FMU to record

        Raises:
            FmuError: the FMU refuses a value, or fails
            ValueError: the cycle, or an argument, is wrong; or the FMU lacks a variable
        """
        rows = _cycle(cycle)
        road = _road(slope, rows)
        if not (np.isfinite(step_size) and step_size > 0.0):
            raise ValueError(f"step_size = {step_size!r} must be greater than 0 s")
        archive = _open(fmu)
        description = _described(archive)
        variables = {v.name: v for v in description.modelVariables}
        lacking = [name for name in (*_INPUTS, *_NEEDED, *_IMPOSED) if name not in variables]
        if lacking:
            raise ValueError(f"{description.modelName} has no {', '.join(lacking)}: a vehicle needs PmsmDrive, PmsmDriveMean or MappedDrive")
        values = dict(start_values or {}) | _IMPOSED
        if sensor:
            values |= {name: value for name, value in _SENSOR.items() if name in variables}
        causes = [name for name in _CAUSES if name in variables]
        temperatures = [name for name in _TEMPERATURES if name in variables]
        outputs = list(dict.fromkeys([*_NEEDED, "speed", *causes, *temperatures, *outputs]))
        if not variables.keys() >= set(outputs):
            raise _no_variable(description, [name for name in outputs if name not in variables], "outputs")
        J = _number(values, variables, "plant.mechanics.J")
        drive = _Drive(archive, description, variables, values, outputs, step_size)
        try:
            return self._drive(drive, J, rows, road, driver, stop_time)
        finally:
            drive.close()

    def _drive(self, drive, J, rows, road, driver, stop_time):
        h, ratio, outputs = drive.h, self.gear / self.radius, drive.outputs
        end = rows[-1, 0] if stop_time is None else min(stop_time, rows[-1, 0])
        time = rows[0, 0] + h * np.arange(round((end - rows[0, 0]) / h) + 1)
        wanted = np.interp(time, rows[:, 0], rows[:, 1] / 3.6)
        rotating = self.inertia / self.radius**2 + J * ratio**2
        mass, (k_p, k_i) = self.mass + rotating, driver
        at = {one: k for k, one in enumerate(outputs)}
        v, angle, integral, distance, before, row = wanted[0], 0.0, 0.0, 0.0, 0.0, drive.read()
        energy = dict.fromkeys(("air", "rolling", "slope", "gear", "brakes"), 0.0)
        record, tau_before = [], 0.0
        for now, (at_start, then) in zip(time, pairwise(wanted)):
            held = at_start == then == 0.0 and v < 0.1
            incline = road(now, distance)
            middle = 0.0 if held else max(v + 0.5 * h * before, 0.0)
            air, rolling, downhill = self._resistances(middle, incline)
            error = at_start - v
            # At a limit of the drive, the integral part waits.
            if not tau_before * error > 0.0 or row[at["tau_min"]] <= tau_before <= row[at["tau_max"]]:
                integral += k_i * self.mass * error * h
            integral = 0.0 if held else integral
            force = 0.0 if held else mass * (then - at_start) / h + air + rolling + downhill + k_p * self.mass * error + integral
            tau = force / ratio
            tau = tau / self.gear_efficiency if tau > 0.0 else tau * self.gear_efficiency
            tau_before = tau
            # What the drive cannot brake, the brakes do.
            brakes = max(0.0, row[at["tau_min"]] - tau) * ratio if tau < 0.0 and middle > 0.0 else 0.0
            tau = min(max(tau, row[at["tau_min"]]), row[at["tau_max"]])
            mechanical, row = row[at["energy_mech"]], drive.step(tau, middle * ratio, angle)
            # The mean torque of the step: the energy that the shaft received.
            turned = middle * ratio * h
            shaft = ((row[at["energy_mech"]] - mechanical) / turned if turned > 1e-3 else row[at["tau_shaft"]]) * ratio
            wheel = shaft * self.gear_efficiency if shaft > 0.0 else shaft / self.gear_efficiency
            before = 0.0 if held else max((wheel - air - rolling - downhill - brakes) / mass, -v / h)
            moved = h * (v + 0.5 * h * before)
            if held:
                v = 0.0
            for cause, one in zip(energy, (air, rolling, downhill, shaft - wheel, brakes)):
                energy[cause] += one * moved
            record.append((now, v, at_start, distance, tau, 100.0 * incline, brakes, *row))
            distance += moved
            angle += turned
            v = max(v + h * before, 0.0)
        names = ["time", "v", "wanted", "distance", "tau_ref", "slope", "brake_force", *outputs]
        result = np.array(record, dtype=[(one, float) for one in names]) if record else np.empty(0, [(one, float) for one in names])
        return Trip(drive.name, result, energy, distance, (mass, wanted[0], v), h)


class _Drive:
    """An instance of the FMU, stepped by `h` (s)."""

    def __init__(self, archive, description, variables, values, outputs, h):
        before, during = _start_values(variables, description, values, True)
        references = lambda names: [variables[name].valueReference for name in names]  # noqa: E731
        self.name, self.outputs, self.h, self._steps = description.modelName, outputs, h, 0
        self._inputs, self._read = references(_INPUTS), references(outputs)
        # None asks the FMU for warnings alone.
        self._fmu = fmu = _instance(archive, _kind(description, "CoSimulation", False, False), debug_logging=None)
        try:
            fmu._setup(None, 0.0, None)
            _apply(fmu, before)
            fmu._enter()
            _apply(fmu, during)
            fmu.exitInitializationMode()
        except BaseException:
            fmu.freeInstance()
            raise

    def read(self):
        return self._fmu._get_reals(self._read)

    def step(self, *inputs):
        self._fmu._set_reals(self._inputs, list(inputs))
        self._fmu.doStep(self._steps * self.h, self.h)
        self._steps += 1
        return self.read()

    def close(self):
        """Give the warnings of the run and free the instance; without those about values that have no effect under a vehicle."""
        texts = {text: None for status, _, text in self._fmu._take_messages() if status == "Warning"}
        self._fmu.freeInstance()
        for text in texts:
            if "no effect" not in text and "speed_shaft and angle_shaft are 0" not in text:
                warnings.warn(text if text.startswith(f"{self.name}: ") else f"{self.name}: {text}", stacklevel=4)


class Trip:
    """A driven cycle.

    Attributes:
        name: of the FMU
        result: structured array with a row per step: time (s), v and wanted (m/s), distance (m), tau_ref (N.m), slope (%), brake_force
            (N), and outputs of the drive
        distance: m
        energy: J by name: `link`, `drawn` and `returned` at the DC link, `shaft`, `losses` of the drive, and `kinetic`
        losses: J by cause: those of the drive, then air, rolling, gear and brakes; `slope` is potential energy
        temperatures: maximum in degC by name, if the FMU has them
    """

    def __init__(self, name, result, of_vehicle, distance, motion, h):
        mass, first, last = motion
        self.name, self.result, self.distance = name, result, distance
        self._h = h
        counter = {one: result[f"energy_{one}"][-1] if len(result) else 0.0 for one in ("in", "mech", "loss")}
        p_in, p_mech = self.power("energy_in"), self.power("energy_mech")
        self.energy = {"link": counter["in"], "drawn": p_in.clip(min=0).sum() * h, "returned": p_in.clip(max=0).sum() * h,
                       "shaft": counter["mech"], "losses": counter["loss"], "kinetic": 0.5 * mass * (last**2 - first**2)}  # fmt: skip
        causes = {title: result[one].sum() * h for one, title in _CAUSES.items() if one in result.dtype.names}
        total = sum(causes.values())
        # The powers of PmsmDrive are means over its last sample period: they share the counter out.
        of_drive = {title: part / total * counter["loss"] for title, part in causes.items()} if total > 0.0 else {"drive": counter["loss"]}
        self.losses = of_drive | of_vehicle
        self.temperatures = {one: result[one].max() - 273.15 for one in _TEMPERATURES if one in result.dtype.names and len(result)}
        received = p_in.clip(min=0).sum() + (-p_mech).clip(min=0).sum()
        self.efficiency = 1.0 - counter["loss"] / (received * h) if received > 0.0 else 0.0

    def power(self, counter="energy_in"):
        """Mean power (W) of each step, from a counter of energy."""
        return np.diff(self.result[counter], prepend=0.0) / self._h

    @property
    def wh_per_km(self):
        """Energy from the DC link per distance (Wh/km)."""
        return self.energy["link"] / 3.6 / self.distance if self.distance > 0.0 else float("nan")

    @property
    def balance(self):
        """Energy from the link without a place, as a share of the energy drawn: all causes, slope and kinetic energy subtracted."""
        rest = self.energy["link"] - sum(self.losses.values()) - self.energy["kinetic"]
        return rest / max(self.energy["drawn"], 1e-9)

    @property
    def error(self):
        """Maximum deviation from the wanted speed (km/h)."""
        return 3.6 * np.abs(self.result["v"] - self.result["wanted"]).max() if len(self.result) else 0.0

    def __str__(self):
        e, km, wh = self.energy, 1e-3 * self.distance, 1 / 3600.0
        per_km = lambda x: f"{x * wh / max(km, 1e-9):9.2f} Wh/km"  # noqa: E731
        lines = [f"{self.name}: {km:.3f} km in {len(self.result) * self._h:.0f} s, speed within {self.error:.2f} km/h",
                 f"{'from the link':<22}{e['link'] * wh:11.2f} Wh  {per_km(e['link'])}",
                 f"{'  drawn':<22}{e['drawn'] * wh:11.2f} Wh", f"{'  returned':<22}{e['returned'] * wh:11.2f} Wh",
                 f"{'efficiency of drive':<22}{100 * self.efficiency:11.2f} %"]  # fmt: skip
        lines += [f"{cause:<22}{x * wh:11.2f} Wh  {per_km(x)}" for cause, x in self.losses.items() if x]
        lines += [f"{name:<22}{x:11.1f} degC at most" for name, x in self.temperatures.items() if np.ptp(self.result[name]) > 0.05]
        return "\n".join([*lines, f"{'not in the balance':<22}{100 * abs(self.balance):11.3f} %"])

    def plot(self, *others, figure=None):
        """Plot with matplotlib: speed, torque, power of the link, losses and, if they change, temperatures; returns the figure.

        Args:
            others: other trips, to compare
            figure: a figure of matplotlib to draw into
        """
        try:
            import matplotlib.pyplot as plt
        except ImportError:
            raise ImportError("a trip's plot needs matplotlib: pip install matplotlib") from None
        trips = (self, *others)
        titles = ["speed [km/h]", "torque [N.m]", "link power [kW]", "losses [kW]"]
        warm = [one for one in self.temperatures if np.ptp(self.result[one]) > 0.1]
        titles += ["temperature [°C]"] if warm else []
        figure = plt.figure(figsize=(8, 1.8 * len(titles)), layout="constrained") if figure is None else figure
        axes = figure.subplots(len(titles), sharex=True)
        for trip, (color, dashes, width) in zip(trips, [("C0", "-", 2.0), ("C1", "--", 1.2), ("black", ":", 1.0), ("C2", "-.", 1.0)]):
            r = trip.result
            curves = [3.6 * r["v"], r["tau_shaft"], 1e-3 * trip.power(), 1e-3 * trip.power("energy_loss")]
            every = max(1, len(r) // 1500)
            for axis, values in zip(axes, curves):
                axis.plot(r["time"][::every], values[::every], dashes, color=color, lw=width, label=trip.name)
            for one in warm if trip is self else []:
                axes[-1].plot(r["time"][::every], r[one][::every] - 273.15, label=one)
        for axis, title in zip(axes, titles):
            axis.set_ylabel(title)
            axis.grid(alpha=0.3)
        if warm:
            axes[-1].legend(loc="best", fontsize="small")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False)
        axes[-1].set_xlabel("time [s]")
        return figure


def _number(values, variables, name):
    """The number of a start value, given as a number or with a unit, or of the description."""
    value = values.get(name, variables[name].start)
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r}: give a number in {variables[name].unit}, which the vehicle also uses") from None


def _cycle(cycle):
    """Rows of time (s), speed (km/h) and, if there, slope (%)."""
    if isinstance(cycle, (str, os.PathLike)):
        path, rows, size = os.fspath(cycle), [], 1.0
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                line = line.split("#")[0].strip()
                if not line:
                    continue
                if not rows and line[0].isalpha():
                    size = _size(line, f"{path}:{number}")
                    continue
                try:
                    row = [float(cell) for cell in line.split(",")]
                except ValueError:
                    raise ValueError(f"{path}:{number}: {line} must be time (s), speed (km/h) and perhaps slope (%)") from None
                if len(row) not in (2, 3) or (rows and len(row) != len(rows[0])):
                    raise ValueError(f"{path}:{number}: has {len(row)} values; expected time, speed and perhaps slope in every line")
                rows.append([row[0], row[1] * size, *row[2:]])
    else:
        path, rows = "cycle", cycle
    rows = np.array(rows, dtype=float)
    if rows.ndim != 2 or rows.shape[1] not in (2, 3) or len(rows) < 2:
        raise ValueError(f"{path}: needs at least two rows of time (s), speed (km/h) and perhaps slope (%)")
    for k, (a, b) in enumerate(pairwise(rows[:, 0])):
        if not b > a:
            raise ValueError(f"{path}: the time {b:g} s of row {k + 2} does not increase")
    if not np.isfinite(rows).all() or rows[:, 1].min() < 0.0:
        raise ValueError(f"{path}: speeds must be numbers of at least 0 km/h")
    fastest, units = rows[:, 1].max(), "check the units, time in s and speed in km/h"
    if fastest > 504.0:
        raise ValueError(f"{path}: vehicles are slower than {fastest:g} km/h: {units}")
    steepest = np.abs(np.diff(rows[:, 1]) / np.diff(rows[:, 0])).max() / 3.6
    # Rows in a program may ask for full torque.
    if steepest > 15.0 and isinstance(cycle, (str, os.PathLike)):
        warnings.warn(f"{path}: vehicles accelerate less than {steepest:g} m/s2: {units}", stacklevel=4)
    return rows


def _size(header, place):
    """Size of the unit of the speed in a header, in km/h."""
    units = {"km/h": 1.0, "m/s": 3.6, "mph": 1.609344}
    unit = re.search(r"\[(.*?)\]", (header.split(",") + [""])[1])
    if unit and unit[1] not in units:
        raise ValueError(f"{place}: the unit {unit[1]} of a speed must be km/h, m/s or mph")
    return units[unit[1]] if unit else 1.0


def _road(slope, rows):
    """The slope as a ratio, at a time (s) and a distance (m)."""
    if rows.shape[1] == 3:
        if np.any(slope):
            raise ValueError("slope: the cycle has a third column with the slope; give one of them")
        return lambda time, distance: float(np.interp(time, rows[:, 0], rows[:, 2])) / 100.0
    table = np.asarray(slope, dtype=float)
    if table.ndim == 0:
        return lambda time, distance: float(table) / 100.0
    if table.ndim != 2 or table.shape[1] != 2 or (np.diff(table[:, 0]) <= 0).any():
        raise ValueError(f"slope = {slope!r} must be a number in %, or rows of (distance in m, slope in %) with increasing distances")
    return lambda time, distance: float(np.interp(distance, table[:, 0], table[:, 1])) / 100.0
