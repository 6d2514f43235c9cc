"""Plots of results: with matplotlib, and as a page with zoom for notebooks."""

import html

import numpy as np

from . import _core

# Maximum number of columns that a notebook shows: the first ones.
_MOST = 24


def units(result):
    """Name -> (unit, factor, offset) for each column: the display unit if the FMU defines one."""
    known = getattr(result, "units", None)
    if known is not None:
        return known
    description, found = getattr(result, "modelDescription", None), {}
    if description is None:
        return found
    variables = {v.name: v for v in description.modelVariables}
    display = {u.name: {d.name: d for d in u.displayUnits} for u in description.unitDefinitions}
    for name in result.dtype.names:
        v = variables.get(name)
        if v is None:
            continue
        unit = v.unit or (v.declaredType and v.declaredType.unit) or ""
        wanted = v.displayUnit or (v.declaredType and v.declaredType.displayUnit)
        shown = display.get(unit, {}).get(wanted)
        relative = v.relativeQuantity or (v.declaredType is not None and v.declaredType.relativeQuantity)
        found[name] = (unit, 1.0, 0.0) if shown is None else (shown.name, shown.factor, 0.0 if relative else shown.offset)
    return found


def curves(result, columns=None):
    """(name, unit, values in that unit) of each numeric column."""
    if getattr(result, "dtype", None) is None or result.dtype.names is None or "time" not in result.dtype.names:
        raise TypeError(f"a result is a structured array with the column time, not {type(result).__name__}")
    if columns is not None:
        columns = [columns] if isinstance(columns, str) else list(columns)
        wrong = [name for name in columns if name not in result.dtype.names]
        if wrong:
            names = list(result.dtype.names)
            has, meant = ", ".join(names), _core.suggest(str(wrong[0]), names)
            raise ValueError(f"the result has no column {', '.join(map(str, wrong))}; it has {has}{meant}")
    shown, all_ = units(result), []
    for name in columns or [name for name in result.dtype.names if name != "time"]:
        if result[name].ndim != 1:
            continue
        unit, factor, offset = shown.get(name, ("", 1.0, 0.0))
        all_.append((name, unit, np.ascontiguousarray(np.asarray(result[name], float) * factor + offset)))
    return all_


def plot(result, columns=None, *, figure=None):
    """Plot a result with matplotlib: a panel for each unit, over time; returns the figure.

    Args:
        result: of `simulate_fmu` or `Plan.simulate`
        columns: names; by default all that are numbers
        figure: a figure of matplotlib to draw into

    Values have their display units, rpm for speeds of a drive.
    """
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        raise ImportError("fmurun.plot needs matplotlib: pip install matplotlib") from None
    panels = {}
    for name, unit, y in curves(result, columns):
        panels.setdefault(unit, []).append((name, y))
    if not panels:
        raise ValueError("there is no column to plot")
    figure = plt.figure(figsize=(8, 1 + 1.8 * len(panels)), layout="constrained") if figure is None else figure
    axes = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axis, (unit, drawn) in zip(axes, panels.items()):
        for name, y in drawn:
            axis.plot(result["time"], y, label=name)
        axis.set_ylabel(f"[{unit}]" if unit else "")
        axis.legend(loc="best", fontsize="small")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time [s]")
    return figure


def page(result, title="fmurun", columns=None):
    """The page with the figure of a result, as HTML: zoom, legend switches, values at the cursor; works offline."""
    return _core.run_page(title, np.ascontiguousarray(result["time"], dtype=float), curves(result, columns))


def frame(result):
    """The notebook representation of a result."""
    names = [name for name in result.dtype.names if name != "time"][:_MOST]
    if not len(result) or not names:
        return None
    height = 60 + 260 * len({unit for _, unit, _ in curves(result, names)})
    text = html.escape(page(result, columns=names), quote=True)
    return f'<iframe srcdoc="{text}" style="width: 100%; height: {min(height, 1600)}px; border: 0"></iframe>'


def pandas_frame(result):
    """A DataFrame with time (s) as its index; enumerations are categories with their names."""
    import pandas

    description = getattr(result, "modelDescription", None)
    variables = {v.name: v for v in description.modelVariables} if description else {}
    columns = {}
    for name in result.dtype.names[1:]:
        v, column = variables.get(name), np.asarray(result[name])
        if column.ndim > 1:
            columns |= {f"{name}[{k}]": x for k, x in enumerate(column.reshape(len(result), -1).T, 1)}
        elif v is not None and v.type == "Enumeration" and v.declaredType:
            names = {int(item.value): item.name for item in v.declaredType.items}
            columns[name] = pandas.Categorical([names.get(x, str(x)) for x in column.tolist()])
        else:
            columns[name] = column
    return pandas.DataFrame(columns, index=pandas.Index(np.asarray(result["time"]), name="time"))
