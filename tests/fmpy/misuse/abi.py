"""The C interface of an unpacked FMU through ctypes alone, the same for FMI 2.0 and FMI 3.0.

Nothing is checked here: every argument can be wrong. Calls return the status; the cases assert what they expect.
"""

import ctypes as c
import platform
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

from .signatures import FUNCTIONS, RETURNS

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

LETTERS = {"p": c.c_void_p, "n": c.c_size_t, "d": c.c_double, "u": c.c_uint32, "i": c.c_int}
BOOLEAN = {2: c.c_int, 3: c.c_uint8}
RESULTS = {"text": c.c_char_p, "instance": c.c_void_p, "nothing": None}

# Base type of a variable -> suffix of its getter and setter, C type.
ACCESS = {
    2: {
        "Real": ("Real", c.c_double),
        "Integer": ("Integer", c.c_int32),
        "Enumeration": ("Integer", c.c_int32),
        "Boolean": ("Boolean", c.c_int32),
    },
    3: {
        "Float64": ("Float64", c.c_double),
        "Int32": ("Int32", c.c_int32),
        "Enumeration": ("Int64", c.c_int64),
        "Boolean": ("Boolean", c.c_uint8),
    },
}
REAL = {2: "Real", 3: "Float64"}

LOGGER = {
    2: c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p),
    3: c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p),
}
ENVIRONMENT = 0xE57  # never followed, only handed back


class Callbacks(c.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(name, c.c_void_p) for name in ("logger", "allocate", "free", "finished", "environment")]


class Variable(NamedTuple):
    """A variable of modelDescription.xml."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    start: str | None
    min: str | None
    max: str | None


class Message(NamedTuple):
    """What the logger received."""

    status: int
    category: str
    text: str
    environment: int | None
    name: str | None


def library(folder, version, identifier):
    """The binary for this machine in the folder of its standard."""
    bits = "64" if sys.maxsize > 2**32 else "32"
    suffix = {"Linux": ".so", "Darwin": ".dylib", "Windows": ".dll"}[platform.system()]
    if version == 2:
        name = {"Linux": "linux", "Darwin": "darwin", "Windows": "win"}[platform.system()] + bits
    else:
        machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
        name = f"{machine}-{platform.system().lower()}"
    return folder / "binaries" / name / (identifier + suffix)


class Fmu:
    """A loaded binary and the content of its XML."""

    def __init__(self, folder):
        self.folder = Path(folder)
        root = ET.parse(self.folder / "modelDescription.xml").getroot()
        self.version = int(root.get("fmiVersion")[0])
        self.identifier = root.find("CoSimulation").get("modelIdentifier")
        self.token = root.get("guid" if self.version == 2 else "instantiationToken")
        self.categories = {x.get("name") for x in root.iterfind("LogCategories/Category")}
        # The cases set and get scalars; tests/types has arrays.
        scalars = [node for node in root.find("ModelVariables") if node.find("Dimension") is None]
        self.variables = {v.name: v for v in map(self._variable, scalars)}
        derivatives = ("Derivatives/Unknown", "ContinuousStateDerivative")[self.version - 2]
        self.states = len(root.findall(f"ModelStructure/{derivatives}"))
        self.path = library(self.folder, self.version, self.identifier)
        self.load()

    def _variable(self, node):
        value = node.find("*") if self.version == 2 else node
        return Variable(
            node.get("name"),
            int(node.get("valueReference")),
            value.tag,
            node.get("causality", "local"),
            node.get("variability"),
            *(value.get(key) for key in ("start", "min", "max")),
        )

    def load(self):
        """Loads the binary and declares all functions of both standards."""
        self.library = c.CDLL(str(self.path))
        for version, functions in FUNCTIONS.items():
            for name, letters in functions.items():
                function = getattr(self.library, name)
                function.argtypes = [{**LETTERS, "b": BOOLEAN[version]}[x] for x in letters]
                function.restype = RESULTS[RETURNS[name]] if name in RETURNS else c.c_int

    def function(self, name):
        """A function of the archive's own standard, by its name without `fmi2` or `fmi3`."""
        return getattr(self.library, f"fmi{self.version}{name}")

    def of(self, *causalities, real=True):
        """Variables of these causalities, in the order of the XML."""
        wanted = [v for v in self.variables.values() if v.causality in causalities]
        return [v for v in wanted if v.type == REAL[self.version]] if real else wanted

    def find(self, name):
        """The variable of this name, with or without the prefix of a component; None if there is none."""
        matches = [v for v in self.variables.values() if v.name == name or v.name.endswith("." + name)]
        return matches[0] if matches else None

    def settable(self):
        """Inputs and parameters of every type."""
        return self.of("input", "parameter", real=False)

    def instance(self, name=b"it", **arguments):
        """A fresh instance; instantiation must succeed. The arguments are those of `instantiate`."""
        it = Instance(self, name, **arguments)
        assert it.handle, f"instantiation was refused: {it.messages}"
        return it


class Instance:
    """One instance: the calls of both standards under one name, and what it logged."""

    def __init__(self, fmu, name=b"it", token=None, logging=True, logger=True, resources=None, type=1, events=False):
        self.fmu, self.version, self.t, self.k = fmu, fmu.version, 0.0, 0
        self.messages = []
        self.logger = LOGGER[self.version](self._log if logger else 0)
        pointer = c.cast(self.logger, c.c_void_p)
        token = fmu.token.encode() if token is None else token or None
        if self.version == 2:
            self.callbacks = Callbacks(pointer, None, None, None, ENVIRONMENT)
            create = fmu.function("Instantiate")
            self.handle = create(name, type, token, resources, c.byref(self.callbacks), 0, logging)
        else:
            create = fmu.function("InstantiateCoSimulation")
            self.handle = create(name, token, resources, 0, logging, events, 0, None, 0, ENVIRONMENT, pointer, None)

    def _log(self, environment, *rest):
        name, (status, category, text) = (None, rest) if self.version == 3 else (rest[0].decode(), rest[1:])
        category = category.decode() if category is not None else None
        self.messages.append(Message(status, category, text.decode(), environment, name))

    def errors(self):
        """Texts of the messages with the status Error."""
        return [m.text for m in self.messages if m.status == ERROR]

    def call(self, name, *arguments):
        """A function of the instance by its name without `fmi2` or `fmi3`."""
        return self.fmu.function(name)(self.handle, *arguments)

    # Values

    def access(self, way, suffix, references, values):
        """Get or Set with arrays of any type."""
        references = (c.c_uint32 * len(references))(*references)
        sizes = (len(values),) if self.version == 3 else ()
        return self.call(way + suffix, references, len(references), values, *sizes)

    def get(self, *names):
        """Values of variables; must succeed."""
        found = []
        for name in names:
            variable = self.fmu.variables[name]
            suffix, kind = ACCESS[self.version][variable.type]
            value = (kind * 1)()
            assert self.access("Get", suffix, [variable.reference], value) == OK, (name, self.messages)
            found.append(value[0])
        return found

    def set(self, name, value):
        """Sets one variable; the status."""
        variable = self.fmu.variables[name]
        suffix, kind = ACCESS[self.version][variable.type]
        return self.access("Set", suffix, [variable.reference], (kind * 1)(value))

    def reals(self, way, variables, values=None):
        """Gets (returned as bytes) or sets all these real variables in one call that must succeed."""
        array = (c.c_double * len(variables))(*(values or []))
        references = [v.reference for v in variables]
        assert self.access(way, REAL[self.version], references, array) == OK, self.messages
        return bytes(array)

    def time(self):
        """Status and last communication point: the variable of FMI 3.0, the status of FMI 2.0."""
        now = (c.c_double * 1)()
        if self.version == 2:
            return self.call("GetRealStatus", 2, now), now[0]
        return self.access("Get", REAL[3], [self.fmu.variables["time"].reference], now), now[0]

    # Life

    def set_up(self, start=0.0, stop=None):
        """Times, and in FMI 3.0 entering initialization as well; the status."""
        name = "SetupExperiment" if self.version == 2 else "EnterInitializationMode"
        self.t, self.k = start, 0
        return self.call(name, 0, 0.0, start, stop is not None, stop or 0.0)

    def enter(self, start=0.0, stop=None):
        """Enters initialization; must succeed."""
        assert self.set_up(start, stop) == OK, self.messages
        assert self.version == 3 or self.call("EnterInitializationMode") == OK, self.messages
        return self

    def begin(self, start=0.0, stop=None):
        """Completes the initialization; must succeed."""
        self.enter(start, stop)
        assert self.call("ExitInitializationMode") == OK, self.messages
        return self

    def step(self, h=1e-4, t=None):
        """One step from `t`, by default from the end of the last one; the status."""
        t = self.t if t is None else t
        if self.version == 2:
            status = self.call("DoStep", t, h, 1)
        else:
            self.flags, self.reached = (c.c_uint8 * 3)(), c.c_double()
            flags = [c.byref(self.flags, i) for i in range(3)]
            status = self.call("DoStep", t, h, 1, *flags, c.byref(self.reached))
        if status == OK:
            self.t = t + h
        return status

    def fail(self):
        """Into the error state, by a step of 0 s."""
        assert self.step(0.0) == ERROR
        return self

    def free(self):
        """Frees it; further calls get NULL."""
        self.call("FreeInstance")
        self.handle = None

    # Saved states

    def state_call(self, name, *arguments):
        """GetFMUState and its relatives; the two standards spell them differently."""
        if self.version == 2:
            name = {"DeserializeFMUState": "DeSerializeFMUstate"}.get(name, name.replace("FMUState", "FMUstate"))
        return self.call(name, *arguments)

    def save(self):
        """A new saved state; must succeed."""
        state = c.c_void_p()
        assert self.state_call("GetFMUState", c.byref(state)) == OK, self.messages
        assert state.value
        return state

    def restore(self, state):
        """Restores a saved state; the status."""
        return self.state_call("SetFMUState", state)

    def forget(self, state):
        """Frees a saved state; the status."""
        return self.state_call("FreeFMUState", c.byref(state))

    def store(self, state):
        """A saved state as bytes; must succeed."""
        size = c.c_size_t()
        assert self.state_call("SerializedFMUStateSize", state, c.byref(size)) == OK, self.messages
        data = (c.c_uint8 * size.value)()
        assert self.state_call("SerializeFMUState", state, data, size) == OK, self.messages
        return bytes(data)

    def recall(self, data, state=None):
        """A saved state from bytes: status and state."""
        state = c.c_void_p() if state is None else state
        array = (c.c_uint8 * len(data)).from_buffer_copy(data)
        return self.state_call("DeserializeFMUState", array, len(data), c.byref(state)), state
