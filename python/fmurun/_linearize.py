"""Linear models of FMUs for Model Exchange."""

import warnings
from dataclasses import dataclass, field

import numpy as np

from . import _core
from ._error import FmuError
from ._instance import _described, _instance, _interface, _kind, _open
from ._simulate import _FLOATS, _apply, _start_values, _value

# Step of central differences, relative to a value or its nominal value.
_STEP = 1e-5


@dataclass
class Linearization:
    """x' = f + A (x - x_0) + B (u - u_0), y = y_0 + C (x - x_0) + D (u - u_0).

    Attributes:
        A, B, C, D: matrices
        states, inputs, outputs: names of the rows and columns
        x, u, y: states, inputs and outputs at the point
        dx: derivatives of the states there
        method: "derivatives" of the FMU, or "differences"
        left_out: a sentence for each part of the FMU that is not in the matrices: what it does at events, such as a sampled controller
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: list
    inputs: list
    outputs: list
    x: np.ndarray = field(repr=False)
    u: np.ndarray = field(repr=False)
    y: np.ndarray = field(repr=False)
    dx: np.ndarray = field(repr=False)
    method: str = "derivatives"
    left_out: list = field(default_factory=list, repr=False)


def linearize(fmu, point=None, *, time=0.0, inputs=None, outputs=None, method=None):
    """The linear model of an FMU for Model Exchange at a point: of its continuous states, between its events.

    Discrete states, such as those of a sampled controller, hold: they are not in the model, and a warning says so. Of such an FMU
    `frequency_response` measures the closed loop.

    Args:
        fmu: an .fmu file
        point: name -> value: parameters, inputs and states; what it does not have starts as in the FMU
        time: of the point (s); the initialization and its event are there
        inputs, outputs: names to keep; by default all continuous real scalars
        method: "derivatives" (the default, of the FMU) or "differences" (central); an FMU without derivatives needs the latter,
            and has it by default

    >>> linear = linearize(PLANT, {"speed": 100.0})
    >>> linear.states
    ['psi_d', 'psi_q', 'speed', 'angle']
    >>> linear.A.shape, linear.B.shape, linear.outputs[0], linear.method
    ((4, 4), (4, 12), 'speed', 'derivatives')
    """
    opened = _open(fmu)
    description = _described(opened)
    _interface(description, "ModelExchange")
    if method not in (None, "derivatives", "differences"):
        raise ValueError(f"method must be derivatives or differences, not {method!r}")
    has = description.modelExchange.providesDirectionalDerivatives
    if method == "derivatives" and not has:
        raise FmuError(None, None, description.modelName, "has no directional derivatives; method='differences' needs none")
    method = method or ("derivatives" if has else "differences")
    variables = {v.name: v for v in description.modelVariables}
    rates = [u.variable for u in description.derivatives]
    states = [rate.derivative for rate in rates]
    real = lambda v: v.type in _FLOATS[:1] + _FLOATS[2:] and not v.shape and v.variability == "continuous" and v.alias is None
    chosen = {}
    for what, names, causality in (("inputs", inputs, "input"), ("outputs", outputs, "output")):
        all_ = {v.name: v for v in description.modelVariables if v.causality == causality and real(v)}
        wrong = [name for name in names or () if name not in all_]
        if wrong:
            meant = ", ".join(f"{name}{_core.suggest(str(name), list(all_))}" for name in wrong)
            raise ValueError(f"{what}: {description.modelName} has no continuous {causality} {meant}")
        chosen[what] = list(all_.values()) if names is None else [all_[name] for name in names]
    given = dict(point or {})
    at = {v.name: _value(v, description, given.pop(v.name))[0] for v in states if v.name in given}
    # Inputs are set again at the point, because the event of the initialization may change their effect.
    before, during = _start_values(variables, description, given, True)
    wrong = [name for name, x in (*at.items(), *((v.name, x) for v, x in before)) if not np.isfinite(np.asarray(x, float)).all()]
    if wrong:
        raise ValueError(f"point: {wrong[0]} is not finite")
    # None asks the FMU for warnings alone.
    instance = _instance(opened, _kind(description, "ModelExchange", False, False), fmu, None)
    try:
        instance._setup(None, float(time), None)
        _apply(instance, before)
        instance._enter()
        _apply(instance, during)
        instance.exitInitializationMode()
        again = True
        while again:
            again, *_, sampled, next_time = instance._update()
        instance._enter_continuous()
        linear = _at(instance, states, rates, at, chosen["inputs"], chosen["outputs"], method)
    finally:
        instance._warn()
        instance.freeInstance()
    held = [v.name for v in description.modelVariables if v.causality == "output" and v.variability == "discrete" and v.type in _FLOATS]
    if sampled:
        linear.left_out.append(f"its time events, the next at {next_time:.6g} s: what it samples and computes there holds")
    if held:
        names = ", ".join(held[:5]) + (", ..." if held[5:] else "")
        linear.left_out.append(f"its {len(held)} discrete outputs, which hold between events: {names}")
    if not states and linear.left_out:
        linear.left_out.append("it has no continuous state: the matrices are empty or a direct gain")
    if linear.left_out:
        left_out = "; ".join(linear.left_out)
        text = f"{description.modelName}: the linear model leaves out {left_out}"
        warnings.warn(f"{text}. frequency_response measures the running FMU", stacklevel=2)
    return linear


def _at(instance, states, rates, at, inputs, outputs, method):
    """The matrices at this point of an instance in Continuous-Time Mode."""
    references = lambda variables: [v.valueReference for v in variables]
    n, refs = len(states), references(inputs)
    x = np.array(instance._vector("states", n))
    x[:] = [at.get(v.name, value) for v, value in zip(states, x)]

    def evaluate(x, u):
        instance._set_states(x.tolist())
        if refs:
            instance._set_reals(refs, u.tolist())
        return np.array(instance._vector("derivatives", n) + instance._get_reals(references(outputs)))

    u = np.array(instance._get_reals(refs)) if refs else np.zeros(0)
    value = evaluate(x, u)
    known, unknown = references(states) + refs, references(rates) + references(outputs)
    matrix = np.zeros((len(unknown), len(known)))
    for k, reference in enumerate(known):
        if method == "derivatives":
            matrix[:, k] = instance._sensitivity(unknown, [reference], [1.0], len(unknown), False)
            continue
        both = []
        nominal = float((states + inputs)[k].nominal or 1.0)
        h = _STEP * max(abs(nominal), abs(x[k] if k < n else u[k - n]))
        for sign in (1.0, -1.0):
            moved = np.concatenate([x, u])
            moved[k] += sign * h
            both.append(evaluate(moved[:n], moved[n:]))
        matrix[:, k] = (both[0] - both[1]) / (2.0 * h)
    names = lambda variables: [v.name for v in variables]
    return Linearization(matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:], names(states), names(inputs),
                         names(outputs), x, u, value[n:], value[:n], method)  # fmt: skip
