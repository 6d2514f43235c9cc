"""FMPy's `simulate_fmu`: its arguments, its result, its bits."""

import re
import warnings
from math import prod

import numpy as np

from . import _core, _plot
from ._instance import _described, _instance, _interface, _kind, _Model, _open

# Columns are grouped by type, in this order.
_COLUMNS = {
    "Real": np.float64, "Integer": np.int32, "Float32": np.float32, "Float64": np.float64, "Int8": np.int8, "UInt8": np.uint8,
    "Int16": np.int16, "UInt16": np.uint16, "Int32": np.int32, "UInt32": np.uint32, "Int64": np.int64, "UInt64": np.uint64,
    "Boolean": np.bool_,
}  # fmt: skip
_FLOATS = ("Real", "Float32", "Float64")
# The minimum and the maximum of each integer type.
_INTEGERS = {f"Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)}
_INTEGERS |= {f"UInt{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)} | {"Integer": _INTEGERS["Int32"]}


class SimulationResult(np.ndarray):
    """A structured array with the column `time` first, and the attribute `modelDescription`.

    A notebook shows it as a figure with zoom; `fmurun.plot` draws it with matplotlib.
    """

    def __array_finalize__(self, made_from):
        self.modelDescription = getattr(made_from, "modelDescription", None)
        self.units = getattr(made_from, "units", None)

    def _repr_html_(self):
        return None if self.dtype.names is None or self.ndim != 1 else _plot.frame(self)

    def to_pandas(self):
        """A DataFrame of pandas with `time` (s) as its index; enumerations have their names."""
        return _plot.pandas_frame(self)


class Recorder:
    """The recorder of `step_finished(time, recorder)`: the instance `fmu`, `modelDescription`, and the rows so far."""

    def __init__(self, fmu, model_description, simulation, dtype):
        self.fmu, self.modelDescription, self._simulation, self._dtype = fmu, model_description, simulation, dtype

    @property
    def rows(self):
        """The rows so far, as tuples."""
        return self.result().tolist()

    @property
    def lastSampleTime(self):
        """Time (s) of the last row."""
        return float(self.result()["time"][-1])

    def sample(self, time, force=False):
        """Record a row now."""
        self._simulation.sample(time)

    def result(self):
        """The rows so far, as `simulate_fmu` returns them."""
        return self._result(False)

    def _result(self, take):
        result = self._simulation.bytes(take).view(self._dtype).view(SimulationResult)
        result.modelDescription = self.modelDescription
        return result


def simulate_fmu(filename, validate=True, start_time=None, stop_time=None, solver=None, step_size=None,
                 relative_tolerance=None, output_interval=None, record_events=True, fmi_type=None, start_values={},
                 apply_default_start_values=False, input=None, output=None, timeout=None, debug_logging=False, visible=False,
                 logger=None, fmi_call_logger=None, step_finished=None, model_description=None, fmu_instance=None,
                 set_input_derivatives=False, remote_platform="auto", early_return_allowed=False, use_event_mode=False,
                 initialize=True, terminate=True, fmu_state=None, set_stop_time=True):  # fmt: skip
    """Simulate an FMU like FMPy 0.3.32: same arguments, same points; for Co-Simulation and with Euler same bits.

    FMUs stay open: another simulation of the same file reads it, compares its bytes and does not unpack it again.

    Args:
        filename: an .fmu file, or the folder that it was extracted to
        validate: refuse start values that could not be set
        start_time, stop_time: of the simulation (s); by default the FMU's default experiment, else 0 and one second more
        solver: for Model Exchange: "Dopri" (the default: Dormand-Prince, its step follows `relative_tolerance`, events are
            located), "RK4" (fixed steps of `step_size`), "Euler" (FMPy's); "CVode" is "Dopri" with a warning
        step_size: of "RK4" and "Euler" (s), not of Co-Simulation; by default a thousandth of the time, rounded to a power of ten
        relative_tolerance: of "Dopri", or of a solver inside the FMU
        output_interval: communication step (s); by default the FMU's, doubled until there are at most 1000 steps
        record_events: Model Exchange: two rows for each event, before and after it
        fmi_type: "CoSimulation" or "ModelExchange"; by default the first of them that the FMU has
        start_values: name -> value, (value, unit) or "1000rpm"; inputs that `input` does not have keep theirs
        input: structured array, its first column is time (s), the others are inputs and tunable parameters
        output: names to record; by default the outputs
        timeout: end after this much time of the clock (s)
        debug_logging: the FMU logs; `logger` gets its messages, without one they are printed. Without `debug_logging`, `logger`
            and `fmi_call_logger`, each warning of the FMU becomes one Python warning
        logger: called like FMPy's for each message, after the step that caused it
        fmi_call_logger: called with a line for each call to the FMU, "fmi3DoStep -> OK"
        step_finished: called with (time, recorder) after each step; False ends the simulation
        model_description, fmu_instance: read and instantiated before; a given instance is not freed
        set_input_derivatives: also set derivatives of continuous inputs (Co-Simulation of FMI 2.0)
        remote_platform: None or "auto"; the FMU needs a binary for this platform
        early_return_allowed, use_event_mode: of Co-Simulation of FMI 3.0, where the FMU has them
        initialize, terminate: False leaves the given instance as it is before and after
        fmu_state: state of `fmu_instance`, or bytes of a serialized one: begin there instead of with an initialization
        set_stop_time: tell the FMU the stop time

    An unknown name raises an error; FMPy ignores it.

    Returns:
        a structured array, one row per communication point, `time` (s) first, then the variables by type

    Raises:
        FmuError: the FMU refuses; the message names variable, value and range
        ValueError: a variable does not exist, or a value does not fit

    >>> import numpy as np
    >>> signals = np.array([(0.0, 0.0), (0.01, 0.0), (0.01, 1.0)], dtype=[("time", float), ("tau_load", float)])
    >>> result = simulate_fmu(PLANT, stop_time=0.1, output_interval=1e-3, input=signals, output=["speed"])
    >>> result.dtype.names, len(result), bool(result["speed"][-1] < 0)
    (('time', 'speed'), 101, True)
    """
    if remote_platform not in ("auto", None):
        raise ValueError(f"remote_platform = {remote_platform!r}: fmurun runs binaries of this platform")
    fmu = fmu_instance.fmu if fmu_instance is not None else _open(filename)
    description = model_description or _described(fmu)
    if fmi_type is None and fmu_instance is not None:
        fmi_type = "ModelExchange" if isinstance(fmu_instance, _Model) else "CoSimulation"
    exchange = _interface(description, fmi_type) == "ModelExchange"
    if exchange and not (initialize and fmu_state is None):
        raise ValueError("a simulation for ModelExchange begins with an initialization: leave initialize and fmu_state")
    if not initialize and fmu_instance is None and fmu_state is None:
        raise ValueError("initialize = False needs fmu_instance or fmu_state")
    kind = _kind(description, "ModelExchange" if exchange else "CoSimulation", use_event_mode, early_return_allowed)

    times, tolerance = _times(description, start_time, stop_time, output_interval, relative_tolerance, exchange, step_size)
    variables = {v.name: v for v in description.modelVariables}
    before, during = _start_values(variables, description, start_values, validate)
    dtype, columns = _columns(description, variables, output)
    samples = None if input is None else _samples(description, variables, input)
    if exchange:
        way = _solver(solver, times, step_size, tolerance) | {"record_events": record_events}
        tolerance = None
    else:
        idle = [name for name, value in (("solver", solver), ("step_size", step_size)) if value is not None]
        if idle:
            warnings.warn(f"{' and '.join(idle)}: no effect in CoSimulation, where output_interval sets the step; "
                          "they are for the solvers of ModelExchange", stacklevel=2)  # fmt: skip
        way = {"variable_step": description.coSimulation.canHandleVariableCommunicationStepSize, "event_mode": kind[1]}
    if set_input_derivatives:
        if exchange or description.fmiVersion != "2.0" or not description.coSimulation.canInterpolateInputs:
            raise ValueError(f"set_input_derivatives = True: {description.modelName} does not interpolate inputs")
        way["input_derivatives"] = True

    instance, warns = fmu_instance, False
    if instance is None:
        talk = logger or (_print_message(description) if debug_logging else None)
        # None asks the FMU for warnings alone.
        warns = not debug_logging and logger is None and fmi_call_logger is None
        instance = _instance(fmu, kind, filename, None if warns else debug_logging, visible, talk, fmi_call_logger)
    talks = instance._loggers != (None, None)
    try:
        if fmu_state is not None:
            state = instance.deserializeFMUState(fmu_state) if isinstance(fmu_state, bytes) else fmu_state
            instance.setFMUState(state)
            if isinstance(fmu_state, bytes):
                instance.freeFMUState(state)
        simulation = _core.Simulation(instance, times, way, columns, samples)
        if initialize and fmu_state is None:
            start, stop, _ = times
            instance._setup(tolerance, start, stop if set_stop_time else None)
            _apply(instance, before)
            instance._enter()
            _apply(instance, during)
            simulation.apply()
            instance.exitInitializationMode()
            simulation.begin()
        else:
            simulation.sample(times[0])
        recorder = Recorder(instance, description, simulation, dtype)
        if step_finished is None and not talks:
            simulation.finish(None if timeout is None else float(timeout))
        else:
            _follow(simulation, recorder, step_finished, timeout)
        if terminate or exchange:
            instance.terminate()
        return recorder._result(True)
    finally:
        if talks:
            instance._talk()
        if warns:
            instance._warn()
        if fmu_instance is None:
            instance.freeInstance()


def _print_message(description):
    """A logger that prints."""
    if description.fmiVersion == "2.0":
        return lambda _, name, status, category, text: print(f"[{name.decode()}] {category.decode()}: {text.decode()}")
    return lambda _, status, category, text: print(f"[{description.modelName}] {category.decode()}: {text.decode()}")


def _follow(simulation, recorder, step_finished, timeout):
    """Step by step with callbacks."""
    from time import time as clock

    begin, talk = clock(), recorder.fmu._talk
    while (timeout is None or clock() - begin <= float(timeout)) and simulation.step():
        talk()
        if step_finished is not None and not step_finished(simulation.time, recorder):
            break


_SOLVERS = ("Dopri", "RK4", "Euler", "CVode")
_told = set()


def _solver(name, times, step_size, tolerance):
    """How to integrate."""
    if name not in (None, *_SOLVERS):
        raise ValueError(f"solver = {name!r}: there is no such solver; expected one of {', '.join(_SOLVERS)}")
    if name == "CVode" and name not in _told:
        _told.add(name)
        warnings.warn("solver='CVode': fmurun has no CVode and integrates with Dopri, which is explicit; "
                      "give solver='Dopri', or FMPy for a stiff FMU", stacklevel=3)  # fmt: skip
    start, stop, interval = times
    rtol = 1e-5 if tolerance is None else tolerance
    if not 1e-14 <= rtol <= 0.1:
        raise ValueError(f"relative_tolerance must be between 1e-14 and 0.1, not {rtol}")
    step = _default_step(stop - start) or interval if step_size is None else float(step_size)
    if not (step > 0.0 and np.isfinite(step)):
        raise ValueError(f"step_size must be positive and finite, not {step}")
    if name in ("Euler", "RK4") and not np.isclose(round(interval / step) * step, interval):
        raise ValueError(f"output_interval {interval} must be a multiple of step_size {step} for the solver {name}")
    return {"solver": "Dopri" if name in (None, "CVode") else name, "step": step, "rtol": rtol}


def _default_step(time):
    """FMPy's step of fixed-step solvers."""
    return 10 ** (np.round(np.log10(time)) - 3) if time > 0.0 else None


def _times(description, start, stop, interval, tolerance, exchange, step_size):
    """(start, stop, interval) in s, and the tolerance, where not given from the default experiment."""
    experiment = description.defaultExperiment
    of = lambda name: None if experiment is None else getattr(experiment, name)
    first = lambda *candidates: next((float(x) for x in candidates if x is not None), None)
    start = first(start, of("startTime"), 0.0)
    stop = first(stop, of("stopTime"), start + 1.0)
    if not (np.isfinite(start) and np.isfinite(stop)):
        raise ValueError(f"start_time {start} and stop_time {stop} must be finite")
    if interval is None and exchange:
        interval = float(_default_step(stop - start) or 1.0) if step_size is None else float(step_size)
        while interval > 0.0 and (stop - start) / interval > 1000:
            interval *= 2
    if interval is None:
        interval = first(description.coSimulation.fixedInternalStepSize, of("stepSize"))
        if interval is not None and not interval > 0.0:
            raise ValueError(f"the step size of the FMU's default experiment is {interval}; give output_interval")
        while interval is not None and (stop - start) / interval > 1000:
            interval *= 2
        if interval is None:
            interval = _auto_interval(stop - start)
    interval = float(interval)
    if not (interval > 0.0 and np.isfinite(interval)):
        raise ValueError(f"output_interval must be positive and finite, not {interval}")
    return (start, stop, interval), first(tolerance, of("tolerance"))


def _auto_interval(t):
    """FMPy's interval for a simulation of length t: 200 to 1000 steps."""
    if t <= 0.0:
        return 1.0
    h = 10 ** (np.round(np.log10(t)) - 3)
    n = t / h
    for limit, factor in ((2500, 5.0), (2000, 4.0), (1000, 2.0)):
        if n >= limit:
            return h * factor
    for limit, divisor in ((200, 5.0), (250, 4.0), (500, 2.0)):
        if n <= limit:
            return h / divisor
    return h


def _start_values(variables, description, given, validate):
    """(variable, values) to set before and during initialization mode, in the order of the description."""
    missing = [name for name in given if name not in variables]
    if missing and validate:
        raise _no_variable(description, missing, "start_values")
    before, during, never = [], [], []
    ordered = [variables[n] for n in given if n in variables] if len(given) < 2 else [v for v in variables.values() if v.name in given]
    for v in ordered:
        entry = (v, _value(v, description, given[v.name]))
        if v.causality == "input" or v.variability != "constant" and v.initial in ("approx", "exact"):
            before.append(entry)
        elif v.causality != "parameter" and v.variability == "tunable":
            during.append(entry)
        else:
            never.append(v.name)
    if never and validate:
        kinds = ", ".join(f"{name} ({variables[name].causality}, {variables[name].variability})" for name in never)
        raise ValueError(f"start_values: {kinds}: is computed by the FMU; set inputs and parameters")
    return before, during


def _no_variable(description, missing, argument):
    """An error that names unknown variables of an argument, each with those that resemble it."""
    names = [v.name for v in description.modelVariables]
    meant = ", ".join(f"{name}{_core.suggest(str(name), names)}" for name in missing)
    return ValueError(f"{argument}: {description.modelName} has no variable {meant}")


def _value(v, description, value):
    """A start value as a list for the setter."""
    if type(value) is tuple:
        if len(value) != 2:
            raise ValueError(f"the start value of {v.name} must be a value or (value, unit), not {value!r}")
        value = _without_unit(v, description, *value)
    if isinstance(value, str) and not v.shape:
        value = _read(v, description, value)
    try:
        if v.type == "Boolean" and isinstance(value, str):
            value = {"true": True, "false": False}[value.lower()]
        convert = float if v.type in _FLOATS else {"Boolean": bool, "String": str}.get(v.type, int)
        elements = [value] if not v.shape else value.split() if isinstance(value, str) else np.ravel(value)
        values = [convert(x) for x in elements]
        least, greatest = _INTEGERS.get(v.type, (None, None))
        if least is not None and not all(least <= x <= greatest for x in values):
            raise ValueError
        if not v.shape:
            return values
    except (TypeError, ValueError, KeyError):
        allowed = {"Boolean": "; expected true or false", "String": ""}.get(v.type, "; expected a whole number" if v.type in _INTEGERS else "")
        raise ValueError(f"the start value {value!r} of {v.name} is not of the type {v.type}{allowed}") from None
    if len(values) != prod(v.shape):
        raise ValueError(f"the start value of {v.name} must have {prod(v.shape)} elements, not {len(values)}")
    return values


def _read(v, description, text):
    """The value of a text: a number that may have a unit, as in `1000rpm`, or the name of an item."""
    if v.type == "Enumeration" and v.declaredType:
        items = {item.name: item.value for item in v.declaredType.items}
        if text not in items and not re.fullmatch(r"\s*[+-]?\d+\s*", text):
            raise ValueError(f"{v.name} = {text} is not one of {', '.join(items)}{_core.suggest(text, list(items))}")
        return items.get(text, text)
    if v.type not in _FLOATS or _is_number(text):
        return text
    parts = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S+)\s*", text)
    if not parts:
        raise ValueError(f"{v.name} = {text} is not a number")
    own, known = _units(v, description)
    if own is None:
        raise ValueError(f"{v.name} = {text} is not a number, and the variable has no unit")
    if parts[2] not in {own, *known}:
        raise ValueError(f"{v.name} = {text} is not a number in {' or '.join([own, *known])}")
    return _without_unit(v, description, float(parts[1]), parts[2])


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def _units(v, description):
    """The unit of a variable, and its display units by name."""
    own = v.unit or (v.declaredType and v.declaredType.unit)
    return own, {u.name: {d.name: d for d in u.displayUnits} for u in description.unitDefinitions}.get(own, {})


def _without_unit(v, description, value, unit):
    """The value in the variable's unit, from one in a display unit."""
    own, known = _units(v, description)
    if unit is None or unit == own:
        return value
    if own is None:
        raise ValueError(f"{v.name} has no unit, and its start value has {unit!r}")
    if unit not in known:
        raise ValueError(f"the unit {unit!r} of the start value of {v.name} is not one of {', '.join([own, *known])}")
    shown = known[unit]
    relative = v.relativeQuantity or (v.declaredType is not None and v.declaredType.relativeQuantity)
    return value / shown.factor if relative else (value - shown.offset) / shown.factor


def _base(v, description):
    """The type by its name of FMI 3.0."""
    return {"Real": "Float64", "Integer": "Int32"}.get(v.type, v.type)


def _apply(instance, entries):
    for v, values in entries:
        if v.type in ("Real", "Float64"):
            instance._set_reals([v.valueReference], values)
        else:
            instance._set(v.type, [v.valueReference], values)


def _columns(description, variables, output):
    """The dtype of the result, and for each type (name of FMI 3.0, value references, sizes)."""
    if output is None:
        names = {v.name for v in _default_output(description)}
    else:
        names = {output} if isinstance(output, str) else set(output)
        missing = [name for name in names if name not in variables and name != "time"]
        if missing:
            raise _no_variable(description, sorted(map(str, missing)), "output")
    fields, groups = [("time", np.float64)], {}
    enumeration = "Integer" if description.fmiVersion == "2.0" else "Int64"
    for v in [variables[n] for n in names if n in variables] if len(names) < 2 else variables.values():
        if v.name in names and v.name != "time":
            groups.setdefault(enumeration if v.type == "Enumeration" else v.type, []).append(v)
    columns = []
    for type_, dtype in _COLUMNS.items():
        group = groups.pop(type_, [])
        fields += [(v.name, dtype, v.shape) if v.shape else (v.name, dtype) for v in group]
        if group:
            references, sizes = [v.valueReference for v in group], [prod(v.shape) for v in group]
            columns.append((_base(group[0], description) if group[0].type != "Enumeration" else
                            {"Integer": "Int32"}.get(type_, type_), references, sizes))  # fmt: skip
    if groups and output is not None:
        (type_, group), *_ = groups.items()
        raise ValueError(f"{group[0].name} has the type {type_}, which has no column; see output")
    return np.dtype(fields), columns


def _default_output(description):
    """The outputs; if there are none, five states, else the first five variables."""
    outputs = [v for v in description.modelVariables if v.causality == "output"]
    states = [u.variable.derivative for u in description.derivatives if u.variable and u.variable.derivative]
    return outputs or states[:5] or description.modelVariables[:5]


def _samples(description, variables, signals):
    """(times, events, groups) of the input: see `input.rs`."""
    if getattr(signals, "dtype", None) is None or signals.dtype.names is None:
        raise TypeError(f"input must be a structured numpy array with a column for time, not {type(signals).__name__}")
    signals = np.atleast_1d(signals)
    first, *names = signals.dtype.names
    if first in variables and variables[first].causality != "independent":
        raise ValueError(f"input: the first column must be the time in s, not {first}, a variable of {description.modelName}")
    t = np.ascontiguousarray(signals[first], dtype=np.float64)
    if not t.size:
        raise ValueError("input has no row")
    if not np.isfinite(t).all() or (np.diff(t) < 0).any():
        raise ValueError("the times of input must be finite and must not decrease")
    unknown = [name for name in names if name not in variables]
    if unknown:
        raise _no_variable(description, unknown, "input")
    wrong = [n for n in names if variables[n].causality != "input" and variables[n].variability != "tunable"]
    if wrong:
        kinds = ", ".join(f"{name} ({variables[name].variability} {variables[name].causality})" for name in wrong)
        raise ValueError(f"{kinds}: neither an input nor a tunable parameter; see input")
    events = {np.inf} | set(t[:-1][np.diff(t) == 0])
    groups = {}
    for v in variables.values() if len(names) > 1 else map(variables.get, names):
        if v.name not in names:
            continue
        if signals[v.name].shape[1:] != v.shape:
            raise ValueError(f"input: {v.name} has the shape {v.shape}, and its column {signals[v.name].shape[1:]}")
        table = signals[v.name].astype(np.float64).reshape(t.size, -1).T
        if v.type == "Float32":
            table = table.astype(np.float32).astype(np.float64)
        elif v.type not in _FLOATS and not (np.isfinite(table).all() and (np.abs(table) <= 2.0**53).all()):
            raise ValueError(f"input: {v.name} has the type {v.type}; a value is not a number or beyond 2^53")
        elif v.type not in _FLOATS:
            table = np.trunc(table)
        if v.variability in ("discrete", "tunable") and t.size > 1:
            events |= set(t[1:][(np.diff(table) != 0).any(axis=0)])
        continuous = v.type in _FLOATS and v.variability not in ("discrete", "tunable")
        # An array is a separate group.
        key = (not continuous, _base(v, description), v.valueReference if v.shape else None)
        groups.setdefault(key, []).append((v.valueReference, table))
    # A stable order: continuous variables before discrete ones, types in the order of the description.
    ordered = sorted(groups.items(), key=lambda item: item[0][0])
    tables = [(base, not discrete, [r for r, _ in g], np.concatenate([x for _, x in g])) for (discrete, base, _), g in ordered]
    return t, np.array(sorted(events)), tables
