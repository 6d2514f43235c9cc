"""The cases by theme."""

from . import arguments, binary, instances, lifecycle, log, state, stored, time, values  # noqa: F401
