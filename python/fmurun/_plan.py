"""Many runs of one system."""

import hashlib
import json
import os
import re
import shutil
import tempfile
import threading
import warnings
from collections import OrderedDict
from contextlib import contextmanager

import numpy as np

from . import _core
from ._error import FmuError
from ._simulate import SimulationResult

_LOCK = threading.Lock()
# Plans of this process by their arguments: a Dask task unpickles its plan and finds it here.
_MADE = OrderedDict()
_KEPT = 16


class Plan:
    """A system of FMUs with its connections, values, times and measures, for one run or for millions.

    A plan can be pickled: it travels as its arguments with a hash of each file, and is opened once a process. Workers
    elsewhere need the files at the same paths, or `embed=True`. Any thread may use it, also after `os.fork`.

    Args:
        fmus: an .fmu file, whose variables go by their names; a dictionary name -> file or a list of files, whose variables
            go by "name.variable"; or an .ssp file
        connections: "by_name" connects each free input to the output of this name, or a list of ("p.i_a", "c.i_a")
        terminals: pairs of terminals to connect, ("p.phases", "c.phases")
        start_values: name -> value, the same in all runs
        input: name -> a number, a list of (time, value) that hold from their time (s) on, or a text as `fmu simulate --input`;
            values are numbers, Booleans, and names of an enumeration's items
        start_time, stop_time, step_size: in s; by default those of the FMUs' default experiments
        output: names that `simulate` records; by default all outputs
        measures: name -> {"of": "p.speed", "is": "min", "after": 0.2}, or a text ("speed" is its final value), or
            (text, function): functions are final, min, max, max_abs, mean, rms, integral, at, rise, settling; see docs/sweeps.md
        unit_conversion: convert numbers between connected variables in different units; False passes them on as they are
        sequential: step the FMUs one after another, each with the new outputs of those before it
        embed: pickle the files, too
        fmi_type: "CoSimulation", "ModelExchange", or a dictionary with the one of each FMU; by default FMUs step themselves if they
            can. FMUs for Model Exchange are integrated as one system: events of any of them are met at their time, and algebraic
            loops are solved. Those for Co-Simulation among them step from one communication point to the next
        solver: for Model Exchange: "Dopri" (the default) or "RK4"
        relative_tolerance: of "Dopri", by default 1e-6, or of the solvers inside FMUs for Co-Simulation, by default those of their
            default experiments

    >>> plan = Plan(PLANT, start_values={"u_a": 10.0, "u_b": -5.0, "u_c": -5.0}, stop_time=0.01, step_size=1e-4,
    ...             output=["i_a"], measures={"last": "i_a", "peak": ("i_a", "max_abs")})
    >>> float(plan.simulate({"motor.R_s": 2.0})["i_a"][-1].round(2))
    4.82
    >>> runs = plan.run_many({"motor.R_s": [2.0, 3.0, -1.0]})
    >>> list(runs), [float(x.round(2)) for x in runs["last"]]
    (['run', 'motor.R_s', 'last', 'peak', 'end', 'error'], [4.82, 3.31, nan])
    >>> "motor.R_s = -1 is not allowed: greater than 0" in runs["error"][2]
    True
    """

    def __init__(self, fmus, *, connections="by_name", terminals=(), start_values=None, input=None, start_time=None,
                 stop_time=None, step_size=None, output=None, measures=None, sequential=False, embed=False,
                 fmi_type=None, solver=None, relative_tolerance=None, unit_conversion=True):  # fmt: skip
        files, self._prefix = _files(fmus)
        name = self._name if self._prefix else lambda name: name
        if isinstance(connections, str) and connections != "by_name":
            raise ValueError(f"connections must be 'by_name' or a list of pairs, not {connections!r}")
        by_name = connections == "by_name" and not _is_ssp(files)
        definition = {
            "fmus": [path if _is_ssp(files) else f"{key}={path}" for key, path in files],
            "auto_connect": by_name and len(files) > 1,
            "connect": [] if connections == "by_name" else [list(pair) for pair in connections],
            "terminal": [list(pair) for pair in terminals],
            "no_unit_conversion": not unit_conversion,
            "sequential": bool(sequential),
            **_integration(fmi_type, solver, relative_tolerance, [key for key, _ in files], _is_ssp(files)),
            "start": _number("start_time", start_time),
            "stop": _number("stop_time", stop_time),
            "step": _number("step_size", step_size),
            "set": {name(key): _scalar(key, value) for key, value in (start_values or {}).items()},
            "input": {name(key): _schedule(key, value) for key, value in (input or {}).items()},
            "measure": {key: _measure(key, value, name) for key, value in (measures or {}).items()},
        }
        if step_size is not None and not float(step_size) > 0.0:
            raise ValueError(f"step_size must be positive, not {step_size}")
        self._make(definition, "", list(output) if output is not None else None, embed)

    @staticmethod
    def from_toml(path, *, output=None, embed=False):
        """The plan of a file of `fmu sweep`, with its design: `rows` are those of the command."""
        path = os.path.abspath(os.fspath(path))
        plan = Plan.__new__(Plan)
        plan._prefix = ""
        plan._make(json.loads(_core.read_definition(path)), os.path.dirname(path), output, embed)
        return plan

    def _make(self, definition, folder, output, embed):
        folder = os.path.abspath(folder)
        paths = [os.path.join(folder, path) for path in _core.paths(json.dumps(definition))]
        contents = [_read(path) for path in paths]
        self._definition, self._folder, self._output, self._embed = definition, folder, output, embed
        self._hashes = [hashlib.sha256(content).hexdigest() for content in contents]
        self._contents = contents if embed else None
        self._core = self._opened()
        for note in self._core.notes():
            warnings.warn(note, stacklevel=3)

    def _opened(self):
        key = json.dumps([self._definition, self._hashes, None if self._embed else self._folder], sort_keys=False)
        with _LOCK:
            if key not in _MADE:
                _MADE[key] = self._open()
                if len(_MADE) > _KEPT:
                    _MADE.popitem(last=False)
            _MADE.move_to_end(key)
            return _MADE[key]

    def _open(self):
        if not self._embed:
            return _core.Plan(json.dumps(self._definition), self._folder)
        # Archives are needed as files only until they are open.
        folder = tempfile.mkdtemp(prefix="fmurun-")
        try:
            paths, copies = _core.paths(json.dumps(self._definition)), []
            for k, (path, content) in enumerate(zip(paths, self._contents)):
                copies.append(os.path.join(folder, f"{k}{os.path.splitext(path)[1]}"))
                with open(copies[-1], "wb") as file:
                    file.write(content)
            return _core.Plan(json.dumps(_elsewhere(self._definition, paths, copies)), self._folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def __getstate__(self):
        return {key: value for key, value in self.__dict__.items() if key != "_core"}

    def __setstate__(self, state):
        self.__dict__.update(state)
        if not self._embed:
            for path, expected in zip(_core.paths(json.dumps(self._definition)), self._hashes):
                path = os.path.join(self._folder, path)
                if hashlib.sha256(_read(path)).hexdigest() != expected:
                    raise FmuError(None, None, None, f"{path}: differs from the file with which the plan was created")
        self._core = self._opened()

    def _name(self, name):
        return self._prefix + name

    def simulate(self, start_values=None):
        """Run once; `start_values` in addition to those of the plan. Returns a structured array with `time` (s) first. Its columns
        are doubles; one with an integer beyond 2**53 has 64-bit integers.

        >>> Plan(PLANT, stop_time=0.01, step_size=1e-3, output=["speed", "i_a"]).simulate().dtype.names
        ('time', 'speed', 'i_a')
        """
        names, values = [], []
        for name, value in (start_values or {}).items():
            names.append(self._name(name))
            values.append(str(_scalar(name, value)) if not isinstance(value, bool) else str(value).lower())
        output = None if self._output is None else [self._name(name) for name in self._output]
        time, columns, texts = self._core.simulate(names, values, output)
        for text in texts:
            warnings.warn(text, stacklevel=2)
        columns = [(name.removeprefix(self._prefix), *more) for name, *more in columns]
        result = np.empty(len(time), [("time", float)] + [(name, values.dtype) for name, values, _ in columns])
        result["time"] = time
        for name, values, _ in columns:
            result[name] = values
        result = result.view(SimulationResult)
        result.units = {name: unit for name, _, unit in columns}
        return result

    def run_many(self, table, *, threads=None, first_run=0, progress=None):
        """Run every row of a table on `threads` threads (all processors by default) with Python's lock released.

        Args:
            table: the values of variables by their names: a dictionary of columns, a structured array, a DataFrame of pandas or
                polars, a Table or RecordBatch of pyarrow; a column `run` numbers the rows
            first_run: number of the first row, if there is no column `run`
            progress: True for a bar of tqdm, in a terminal or a notebook; or a function of (rows done, rows)

        Returns:
            a dictionary of arrays: `run`, the columns of the table, the measures, `end` (time reached, s) and, as the last,
            `error`; beside a measure of that name, `run.end` and `run.error`. A run that fails has NaN for its measures and one line
            as its error, otherwise "". Same bits for any number of threads. Enumerations have their names, in the table and in
            measures of their values ("" where a run fails). One Python warning counts the runs in which the FMUs warn: all are
            asked, or every 16th of more than 1000.
        """
        results, text = self._run_many(table, threads=threads, first_run=first_run, progress=progress)
        if text:
            warnings.warn(text, stacklevel=2)
        return results

    def _run_many(self, table, *, threads=None, first_run=0, progress=None):
        """The results, and a sentence about warnings of the FMUs, if there are any."""
        columns = {str(name): column for name, column in _columns(table).items()}
        runs = columns.pop("run", None)
        for name in columns:
            if name in self.measures:
                raise ValueError(f"the measure {name} has the name of a column of the table: rename the measure")
        values = [_values(name, column, self._core, self._name(name)) for name, column in columns.items()]
        if not values:
            raise ValueError("the table has no column; expected one with the values of each varied variable")
        lengths = {name: len(column) for name, column in zip(columns, values)}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"the columns are not of one length: {', '.join(f'{k} {n}' for k, n in lengths.items())}")
        n = len(values[0])
        if n == 0:
            raise ValueError("the table has no row")
        runs = first_run + np.arange(n) if runs is None else np.asarray(runs, dtype=np.int64)
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        with _bar(progress, n) as advance:
            names = [self._name(name) for name in columns]
            measures, end, errors, text = self._core.run_many(names, values, runs, threads or 0, advance)
        results = [*self._named(dict(zip(columns, values))).values(), *map(_named, self._core.measure_items, measures)]
        return dict(zip(self._columns(columns), [runs, *results, end, np.array(errors, dtype=object)])), text

    def gradient(self, at, *, step=1e-4, threads=None):
        """The measures and their derivatives with respect to variables, by central differences of runs, all in parallel.

        In Model Exchange, the two runs of a difference are integrated in common steps: what is differentiated is the computed
        solution, so the derivatives are as exact as the solution itself, at any tolerance of the solver.

        Args:
            at: name -> value: the point
            step: of the differences, relative to a value, absolute for 0
            threads: by default all processors

        Returns:
            measure -> value, and measure -> name -> derivative

        >>> plan = Plan(PLANT, stop_time=0.01, step_size=1e-4, start_values={"u_b": -5.0, "u_c": -5.0}, measures={"i": "i_a"})
        >>> value, gradient = plan.gradient({"u_a": 10.0})
        >>> bool(abs(gradient["i"]["u_a"] * 10.0 - value["i"]) < 0.5 * value["i"])
        True
        """
        if not at or not self.measures:
            raise ValueError("gradient needs at least one variable and one measure")
        if not (np.isfinite(step) and step > 0.0):
            raise ValueError(f"step must be positive and finite, not {step}")
        point = np.array([_number(name, value) for name, value in at.items()])
        h = step * np.where(point == 0.0, 1.0, np.abs(point))
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        measures, errors, text = self._core.run_around([self._name(name) for name in at], point, h, threads or 0)
        failed = [error for error in errors if error]
        if failed:
            raise FmuError(None, None, None, f"gradient: {failed[0]}")
        if text:
            warnings.warn(text, stacklevel=2)
        n = len(point)
        values = {name: float(runs[0]) for name, runs in zip(self.measures, measures)}
        slopes = {name: (runs[1 : n + 1] - runs[n + 1 :]) / (2.0 * h) for name, runs in zip(self.measures, measures)}
        return values, {name: dict(zip(at, slope.tolist())) for name, slope in slopes.items()}

    def _columns(self, varied):
        """Names of the columns of results."""
        named = ["run", *varied, *self.measures]
        return named + self._core.last_columns(named)

    def _named(self, columns):
        """Columns of varied variables, enumerations with their names."""
        return {name: _named(self._core.items(self._name(name)), column) for name, column in columns.items()}

    def rows(self, first, count):
        """Rows of the design of a file: as many of the `count` rows from number `first` on as there are, with their `run`."""
        start, columns = self._core.rows(first, count)
        n = len(next(iter(columns.values()), []))
        return {"run": start + np.arange(n), **self._named(columns)}

    def __len__(self):
        """Number of rows of the design."""
        return self._core.count

    @property
    def measures(self):
        """Names of the measures."""
        return list(self._definition["measure"])

    def meta(self, columns=None):
        """The columns and types that `run_many` returns, without rows. `columns` are the varied ones, by default the design's."""
        columns = self._core.varied if columns is None else columns
        varied = self._named({name: np.empty(0) for name in columns})
        measures = [_named(items, np.empty(0)) for items in self._core.measure_items]
        last = [np.empty(0), np.empty(0, dtype=object)]
        return dict(zip(self._columns(varied), [np.empty(0, dtype=np.int64), *varied.values(), *measures, *last]))


@contextmanager
def _bar(progress, total):
    """A function of the number of rows done, or None."""
    if progress is None or progress is False:
        yield None
    elif callable(progress):
        yield lambda done: progress(done, total)
    else:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise ImportError("progress=True needs tqdm: pip install tqdm; or give a function of (done, rows)") from None
        with tqdm(total=total, unit="run") as bar:
            yield lambda done: bar.update(done - bar.n)


def _named(items, column):
    """Numbers with the names of an enumeration, if `items` has any: "" for NaN, the number as text where there is no name."""
    if not items:
        return column
    names = dict(items)
    return np.array([names.get(x, "" if x != x else f"{x:.17g}") for x in column.tolist()], dtype=object)


def _integration(fmi_type, solver, tolerance, names, ssp):
    """How to run the FMUs, in the form of a definition."""
    one = fmi_type if isinstance(fmi_type, dict) else dict.fromkeys(names, fmi_type)
    for name, kind in one.items():
        if name not in names and not ssp:
            raise ValueError(f"fmi_type: {name} is not the name of an FMU; expected one of {', '.join(names)}")
        if kind not in (None, "CoSimulation", "ModelExchange"):
            raise ValueError(f"fmi_type of {name} must be CoSimulation or ModelExchange, not {kind!r}")
    if solver not in (None, "Dopri", "RK4"):
        raise ValueError(f"solver = {solver!r}: there is no such solver; expected Dopri or RK4")
    exchange = "ModelExchange" in one.values()
    stepping = [name for name, kind in one.items() if kind == "CoSimulation"] if exchange else []
    interface = "ModelExchange" if exchange else next(iter(one.values()), None)
    return {"interface": interface, "stepping": stepping, "solver": solver, "rtol": _number("relative_tolerance", tolerance)}


def _files(fmus):
    """(name, path) of each file, and the prefix of names that users leave out."""
    if isinstance(fmus, (str, os.PathLike)):
        path = os.path.abspath(os.fspath(fmus))
        if path.lower().endswith(".ssp"):
            return [("", path)], ""
        name = os.path.splitext(os.path.basename(path))[0]
        return [(name, path)], f"{name}."
    items = fmus.items() if hasattr(fmus, "items") else [(os.path.splitext(os.path.basename(os.fspath(f)))[0], f) for f in fmus]
    files = [(str(name), os.path.abspath(os.fspath(path))) for name, path in items]
    if not files:
        raise ValueError("fmus is empty; expected an .fmu file, a dictionary name -> file, or an .ssp file")
    return files, ""


def _is_ssp(files):
    return files[0][1].lower().endswith(".ssp")


def _read(path):
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise FmuError(None, None, None, f"{path}: {error.strerror or error}") from None


def _elsewhere(definition, paths, copies):
    """The definition with copies of its files: those of the FMUs, then that of the design."""
    fmus = [text.removesuffix(path) + copy for text, path, copy in zip(definition["fmus"], paths, copies)]
    changed = {**definition, "fmus": fmus}
    if len(copies) > len(fmus):
        changed["design"] = {**definition["design"], "file": copies[-1]}
    return changed


def _number(what, value):
    if value is None:
        return None
    try:
        value = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{what} must be a number in s, not {value!r}") from None
    if not np.isfinite(value):
        raise ValueError(f"{what} must be finite, not {value}")
    return value


def _scalar(name, value):
    """A start value in the form of a definition."""
    value = value.item() if isinstance(value, (np.generic, np.ndarray)) and np.ndim(value) == 0 else value
    if isinstance(value, float) and not np.isfinite(value):
        raise ValueError(f"the start value of {name} must be finite, not {value}")
    if not isinstance(value, (bool, int, float, str)):
        raise TypeError(f"the start value of {name} must be a number, a Boolean or a text, not {value!r}")
    return value


def _schedule(name, value):
    """An input in the form of `fmu simulate --input`: integers keep their digits, items of an enumeration their names."""
    if isinstance(value, str):
        return value
    try:
        if np.ndim(value) == 0:
            return _sample(name, value)
        return ",".join(f"{float(t)!r}:{_sample(name, x)}" for t, x in value)
    except (TypeError, ValueError) as error:
        if str(error).startswith("the input"):
            raise
        raise TypeError(f"the input {name} must be a number, a list of (time, value) or a text, not {value!r}") from None


def _sample(name, value):
    """A value of an input over time."""
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int):
        return str(value)
    if not isinstance(value, str):
        return repr(float(value))
    if re.search(r",[^,:]*:", value):
        raise ValueError(f"the input {name} has the value {value!r}, whose comma and colon would begin another point")
    return value


def _measure(key, value, name):
    """A measure in the form of a definition."""
    if isinstance(value, str):
        value = {"of": value, "is": "final"}
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        value = {"of": value[0], "is": value[1]}
    if not isinstance(value, dict) or not isinstance(value.get("of"), str):
        raise TypeError(f"the measure {key} must be a text, (text, function) or a dictionary with 'of' and 'is', not {value!r}")
    words = [word if word in "+-*" or _is_float(word) else name(word) for word in value["of"].split()]
    return {**value, "of": " ".join(words)}


def _is_float(word):
    try:
        float(word)
    except ValueError:
        return False
    return True


def _columns(table):
    """Columns by name, from any table."""
    if isinstance(table, dict):
        return table
    if isinstance(table, np.ndarray) and table.dtype.names:
        return {name: table[name] for name in table.dtype.names}
    names = getattr(table, "column_names", None)  # pyarrow
    names = getattr(table, "columns", None) if names is None else names  # pandas, polars
    if names is None or callable(names):
        kind = type(table).__name__
        raise TypeError(f"the table must be a dictionary of columns, a structured array or a DataFrame, not {kind}")
    return {name: table[name] for name in names}


def _values(name, column, core, full):
    """A column as numbers; texts are names of an enumeration."""
    array = np.atleast_1d(np.asarray(column))
    if array.ndim != 1:
        raise ValueError(f"the column {name} has {array.ndim} dimensions; expected one")
    if array.dtype.kind in "OUS" and all(isinstance(x, str) for x in array.tolist()):
        column = [core.number(full, x) for x in array.tolist()]
        array = np.atleast_1d(np.asarray(column))
    if isinstance(column, (list, tuple)) and array.dtype.kind in "fO":
        wide = [x for x in column if isinstance(x, (int, np.integer)) and int(float(x)) != int(x)]
        if wide:
            raise ValueError(f"the column {name} has {wide[0]} beside numbers of other types: digits would be lost")
    # NumPy also converts other kinds to numbers, for example None to NaN.
    bad = [] if array.dtype.kind in "biuf" else [x for x in array.tolist() if not isinstance(x, (int, float))]
    if bad:
        raise TypeError(f"the column {name} must have numbers, not {bad[0]!r}")
    # Doubles, unless they lose digits.
    exact = array.dtype.kind in "iu" and any(abs(int(x)) > 2**53 for x in (array.min(initial=0), array.max(initial=0)))
    wide = np.uint64 if array.dtype.kind == "u" else np.int64
    return np.require(array, wide if exact else np.float64, ["C", "A"])
