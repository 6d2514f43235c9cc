"""A machine from a record of its running drive."""

import json

import numpy as np

from . import _core


def identify(frame, *, n_p, current=None, speed=None, torque=None, u_dc=None, delay=None, every=None, rate=None, zero=None,
             load=None, map=None, units=None):  # fmt: skip
    """Resistance, inductances, magnet flux, inertia and friction of a machine, by `fmu identify`.

    Args:
        frame: pandas DataFrame, dictionary of arrays, or structured array with a column per signal: t, u_a, u_b, u_c, i_a, i_b,
            i_c, theta, ...; a header may have a unit: "i_a [mA]"
        n_p: pole pairs
        current: maximum current (A); by default the maximum in the record
        speed: rated mechanical speed (rad/s); by default the maximum in the record
        torque: rated torque (N.m); by default the maximum in the record
        u_dc: DC-link voltage (V); by default the mean of the column u_dc
        delay: samples from a row to the action of its voltage; by default the best of 0, 0.5, 1, 1.5, 2
        every: the record keeps one of so many samples of the controller
        rate: rows per second, where there is no column t
        zero: two times (s) between which there is no current
        load: "none" for a free shaft; else a column with the load torque
        map: column -> header, for columns with other headers
        units: column -> unit

    Returns a dictionary: `values` has, for each quantity, `value` (None if it is refused), `half_width` (relative, 95 %), `unit` and
    `refused` (the reason, or None). Raises `FmuError` for a record that cannot be used.
    """
    names = frame.dtype.names if isinstance(frame, np.ndarray) else list(frame)
    if names is None:
        raise ValueError("frame: expected a DataFrame, a dictionary of arrays, or a structured array")
    renamed = {} if map is None else dict(map)
    if load is not None and load not in ("none", "tau_load", "tau_shaft"):
        renamed["tau_load"], load = load, "tau_load"
    options = {
        "naming": {"map": list(renamed.items()), "units": list((units or {}).items())},
        "n_p": n_p, "current": current, "speed": speed, "torque": torque, "u_dc": u_dc, "delay": delay, "every": every,
        "rate": rate, "zero": zero, "load": load,
    }  # fmt: skip
    columns = []
    for name in names:
        values = np.asarray(frame[name])
        if np.issubdtype(values.dtype, np.number) or values.dtype == bool:
            columns.append((str(name), values.astype(float).ravel().tolist()))
    return json.loads(_core.identify(columns, json.dumps(options)))
