"""Many instances of one FMU that step in one call."""

import os

import numpy as np

from . import _core
from ._simulate import _no_variable, _value
from ._instance import _described, _open


class Batch(_core.Batch):
    """`n` instances of an FMU that step together, for reinforcement learning and, with n = 1, for loops written by hand.

    Times begin at 0; instance k is at `steps * step_size` (s). All calls release Python's lock, and any thread may make them. The first
    warning of the FMUs after an initialization becomes a Python warning; `warned` has those of all instances.

    Args:
        fmu: an .fmu file
        n: number of instances
        actions: variables that `step` writes: inputs and tunable parameters
        observations: variables that `step` and `reset` read
        step_size: communication step (s)
        start_values: name -> value, or an array with a value for each instance
        threads: threads that share the instances

    >>> batch = Batch(PLANT, n=2, actions=["u_a", "u_b", "u_c"], observations=["i_a", "speed"], step_size=1e-4)
    >>> batch.reset()
    array([[0., 0.],
           [0., 0.]])
    >>> observations = batch.step([[10.0, -5.0, -5.0], [20.0, -10.0, -10.0]], repeat=10)
    >>> bool(0.0 < observations[0, 0] < observations[1, 0])
    True
    >>> steps, state = batch.save(1)
    >>> batch.restore(0, (steps, state))
    >>> bool(batch.observe()[0, 0] == observations[1, 0])
    True
    """

    def __new__(cls, fmu, n=1, *, actions, observations, step_size, start_values=None, threads=1):
        path = os.fspath(fmu)
        description = _described(_open(path))
        start = _start(description, n, start_values)
        made = super().__new__(cls, path, n, list(actions), list(observations), step_size, start, threads)
        made.actions, made.observations, made.step_size = tuple(actions), tuple(observations), step_size
        made._description = description
        return made

    def reset(self, mask=None, start_values=None):
        """Return to the start; with a `mask` (n Booleans) only these instances. Returns the observations of all.

        Without `start_values` an instance returns to its last initialization, which is a saved state where the FMU has
        states. With `start_values`, those of the constructor are replaced and the instances initialize again. An instance
        that failed is replaced by a new one.
        """
        mask = None if mask is None else np.asarray(mask, dtype=bool)
        start = None if start_values is None else _start(self._description, self.n, start_values)
        return self._reset(mask, start)


def _start(description, n, values):
    """(name, one value or n values) for each start value."""
    variables, start = {v.name: v for v in description.modelVariables}, []
    for name, given in (values or {}).items():
        if name not in variables:
            raise _no_variable(description, [name], "start_values")
        single = isinstance(given, (str, tuple)) or np.ndim(given) == 0
        row = [float(_value(variables[name], description, x)[0]) for x in ([given] if single else given)]
        if len(row) not in (1, n):
            raise ValueError(f"{name} has {len(row)} start values for {n} instances")
        start.append((name, row))
    return start
