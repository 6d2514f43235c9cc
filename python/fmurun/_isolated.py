"""Runs a function of this package in a separate process, so that an FMU that crashes does not end the interpreter."""

import importlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import warnings

from ._error import FmuError

_SERVE = """
import pickle, sys
with open(sys.argv[1] + ".path", "rb") as file:
    sys.path[:] = pickle.load(file)
from fmurun._isolated import _serve
_serve(sys.argv[1])
"""


def isolated(module, name, arguments):
    """The result of a function of this package with the keyword `arguments`; its warnings and errors are raised here."""
    with tempfile.TemporaryDirectory(prefix="fmurun-") as folder:
        path = os.path.join(folder, "call")
        _dump(path + ".path", sys.path)
        _dump(path, (module, name, arguments))
        # Not `multiprocessing`: that would import the main module again.
        command = [sys.executable, "-c", _SERVE, path]
        ended = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=sys.__stderr__, check=False)
        try:
            with open(path + ".result", "rb") as file:
                result, error, said = pickle.load(file)
        except (OSError, EOFError):
            raise FmuError(None, None, None, f"{name}: the process of the FMUs {_end(ended.returncode)}") from None
    for text, category in said:
        warnings.warn(text, category, stacklevel=3)
    if error is not None:
        raise error
    return result


def _serve(path):
    with open(path, "rb") as file:
        module, name, arguments = pickle.load(file)
    result = error = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            result = getattr(importlib.import_module(f"fmurun.{module}"), name)(**arguments)
        except Exception as raised:  # noqa: BLE001, raised again in the other process
            error = raised
    _dump(path + ".part", (result, error, [(str(warning.message), warning.category) for warning in caught]))
    os.replace(path + ".part", path + ".result")


def _dump(path, value):
    with open(path, "wb") as file:
        pickle.dump(value, file)


def _end(code):
    return f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
