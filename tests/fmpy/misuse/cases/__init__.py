"""The cases by subject."""

from . import arguments, binary, instances, lifecycle, log, state, stored, time, values  # noqa: F401
