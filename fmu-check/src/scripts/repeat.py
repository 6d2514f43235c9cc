import ctypes
import faulthandler
import re
import shutil
import sys
from ctypes import byref, c_bool, c_double

from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2FMUstate
from fmpy.fmi3 import FMU3Model, FMU3Slave, fmi3FMUState

STATUS = ["OK", "Warning", "Discard", "Error", "Fatal", "Pending"]


# FMPy wants every function of the standard; one that the FMU does not export returns Error here.
MISSING = ctypes.CFUNCTYPE(ctypes.c_int)(lambda: 3)
find = ctypes.CDLL.__getattr__


def find_or_missing(library, name):
    try:
        return find(library, name)
    except AttributeError:
        if not name.startswith("fmi"):
            raise
        return MISSING


ctypes.CDLL.__getattr__ = find_or_missing


class NotRepeated(Exception):
    """FMPy has no such call, or not with these arguments."""


class Instance:
    """An instance, and the calls of its FMU by name."""

    def __init__(self, md, folder, function, arguments):
        exchange = "ModelExchange" in function + arguments
        interface = md.modelExchange if exchange or not md.coSimulation else md.coSimulation
        self.md, self.v2 = md, md.fmiVersion.startswith("2.")
        made = {(True, True): FMU2Model, (True, False): FMU2Slave, (False, True): FMU3Model, (False, False): FMU3Slave}
        name = re.match(r'"(.*?)"', arguments)
        token = re.search(r'guid="(.*?)"', arguments)
        self.fmu = made[self.v2, exchange](
            guid=token[1] if token else md.guid,
            unzipDirectory=folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName=name[1] if name else "",
            requireFunctions=False,
        )
        events = {} if self.v2 or exchange else {"eventModeUsed": "eventModeUsed" in arguments}
        try:
            self.fmu.instantiate(loggingOn="loggingOn" in arguments, **events)
        except Exception:
            self.fmu.component = None
        states = md.numberOfContinuousStates
        self.size = {"EventIndicators": md.numberOfEventIndicators}
        self.states = states

    def variable(self, name):
        for v in self.md.modelVariables:
            if v.name == name:
                return v
        raise NotRepeated(f"there is no variable {name}")

    def accessor(self, verb, of):
        names = {"Float64": "Real", "Int32": "Integer", "Enumeration": "Integer"} if self.v2 else {"Enumeration": "Int64"}
        name = verb + names.get(of, of)
        if not hasattr(self.fmu, name):
            raise NotRepeated(f"FMPy has no {name}")
        return getattr(self.fmu, name)

    def vector(self, function, given=None):
        n = self.size.get(function[3:], self.states)
        values = (c_double * max(n, 1))(*(given or []))
        getattr(self.fmu, function[0].lower() + function[1:])(values, n)
        return list(values)[:n]

    def call(self, function, arguments, states):
        """Makes a call; returns what it gives."""
        fmu = self.fmu
        unknown = re.fullmatch(r"(\w+), reference=(\d+)", arguments)
        if function in ("Get", "Set") and unknown:
            count = {"nValues": 1} if function == "Get" and not self.v2 else {}
            values = {"Get": [], "Set": [["x" if unknown[1] == "String" else 0]]}[function]
            self.accessor(function.lower(), unknown[1])([int(unknown[2])], *values, **count)
            return None
        if function in ("Get", "GetString"):
            v = self.variable(arguments)
            count = {} if self.v2 else {"nValues": size(v, self.md)}
            return [text(x) for x in self.accessor("get", v.type)([v.valueReference], **count)]
        if function in ("Set", "SetString"):
            name, _, value = arguments.partition(" = ")
            v = self.variable(name)
            values = [literal(value)] if v.type == "String" else [number(v, x) for x in value.split()]
            return self.accessor("set", v.type)([v.valueReference], values)
        if function == "DoStep":
            known = re.fullmatch(r"t=(\S+), h=(\S+?)(, noSetFMUStatePriorToCurrentPoint=true)?", arguments)
            if not known:
                raise NotRepeated(f"DoStep({arguments})")
            return fmu.doStep(float(known[1]), float(known[2]), bool(known[3]))
        if function in ("SetupExperiment", "EnterInitializationMode"):
            start = re.search(r"startTime=([^,)]+)", arguments)
            stop = re.search(r"stopTime=([-+.\deE]+)", arguments)
            times = {"startTime": float(start[1]), "stopTime": float(stop[1]) if stop else None} if start else {}
            return (fmu.setupExperiment if function == "SetupExperiment" else fmu.enterInitializationMode)(**times)
        if function == "SetTime":
            return fmu.setTime(float(arguments))
        if function == "SetContinuousStates":
            return self.vector(function, floats(arguments)) and None
        if function in ("GetContinuousStates", "GetDerivatives", "GetContinuousStateDerivatives", "GetEventIndicators"):
            return self.vector(function)
        if function == "GetNominalsOfContinuousStates":
            return self.vector(function)
        if function in ("NewDiscreteStates", "UpdateDiscreteStates"):
            (fmu.newDiscreteStates if self.v2 else fmu.updateDiscreteStates)()
            return None
        if function == "GetFMUState":
            state = states[-1] if arguments else (fmi2FMUstate if self.v2 else fmi3FMUState)()
            (fmu.fmi2GetFMUstate if self.v2 else fmu.fmi3GetFMUState)(fmu.component, byref(state))
            states.append(state)
            return None
        if function in ("SetFMUState", "FreeFMUState") and states and not arguments.startswith(("NULL", "&NULL")):
            if function == "SetFMUState":
                return (fmu.setFMUstate if self.v2 else fmu.setFMUState)(states[-1])
            return (fmu.freeFMUstate if self.v2 else fmu.freeFMUState)(states.pop())
        simple = function[0].lower() + function[1:]
        if arguments or not hasattr(fmu, simple):
            raise NotRepeated(function)
        getattr(fmu, simple)()
        return None


def size(v, md):
    """The number of elements of a variable."""
    n = 1
    for dimension in v.dimensions or []:
        of = dimension.start if dimension.start is not None else dimension.variable.start
        n *= int(of)
    return n


def number(v, value):
    return float(value) if v.type in ("Real", "Float64", "Float32") else int(value)


def literal(value):
    """A text as the log of calls has it: "ab", or "x" * 1000."""
    one, _, times = value.rpartition('" * ')
    known = one[1:] * int(times) if times.isdigit() and one else value[1:-1]
    return known


def text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def floats(line):
    return [float(x) for x in re.findall(r"[-+]?(?:inf|NaN|\d[\d.]*(?:e[-+]?\d+)?)", line)]


def alike(expected, values):
    """Whether values are those of the log of calls."""
    if expected.startswith('"') or expected in ("NULL", "None"):
        return not values or isinstance(values[0], str) is False or values[0] == literal(expected)
    numbers = floats(expected)
    same = [a == b or (a != a and b != b) for a, b in zip(numbers, map(float, values))]
    return len(numbers) == len(values) and all(same)


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else FILE
    md, folder = read_model_description(path, validate=False), extract(path)
    if not CALLS:
        # The library does not load, so that there was no call.
        try:
            Instance(md, folder, "Instantiate", '"probe"')
        except Exception as e:
            print(f"{e}\nfmu check found:", *EVIDENCE, sep="\n  ")
            sys.exit(0)
        print("FMPy loads it.")
        sys.exit(1)
    instances, states = {}, []
    repeated = different = left_out = 0
    last, values_of = False, {}
    # What did not return in fmu check does not return here either.
    faulthandler.dump_traceback_later(60, exit=True)
    for line in CALLS:
        known = re.fullmatch(r"(?:\[(\d+)\] )?fmi[23](\w+)(?:\((.*?)\))?(?: -> (.*))?", line, re.DOTALL)
        if not known:
            print(f"      {line}")
            continue
        which, function, arguments, expected = known[1] or "1", known[2], known[3] or "", known[4]
        if expected is None:
            print(f"      {line}: in fmu check this call did not return", flush=True)
        status, values = "OK", None
        try:
            if function.startswith("Instantiate"):
                instances[which] = Instance(md, folder, function, arguments)
                status = "an instance" if instances[which].fmu.component else "NULL"
            elif function == "FreeInstance":
                instances.pop(which).fmu.freeInstance()
                status = ""
            elif which not in instances:
                raise NotRepeated("there is no instance")
            else:
                values = instances[which].call(function, arguments, states)
        except FMICallException as e:
            status = STATUS[e.status] if e.status in range(6) else str(e.status)
        except NotRepeated as e:
            left_out, last = left_out + 1, False
            print(f"      {line}  (not repeated: {e})")
            continue
        repeated, last = repeated + 1, True
        if isinstance(values, list):
            values_of.setdefault(int(which), []).append((function, arguments, values))
        expected_status, _, expected_values = (expected or "").partition(", ")
        same = expected is not None and (expected_status == status or {expected_status, status} <= {"OK", "Warning"} or not status)
        if same and isinstance(values, list) and expected_values:
            same = alike(expected_values, values)
        different += not same
        found = f"{status}, {values}" if isinstance(values, list) else status
        print(f"{'   ' if same else 'NOT'}   {line}" + ("" if same else f"  (here: {found})"), flush=True)
    shutil.rmtree(folder, ignore_errors=True)
    print(f"\n{repeated} calls repeated, {left_out} left out; {different} gave other results than in fmu check.")
    if VARIES == "instances":
        pairs = [(values_of.get(k, []), values_of.get(k + 1, [])) for k in range(1, len(values_of) + 1, 2)]
        seen = any(repr(one) != repr(other) for one, other in pairs)
    elif VARIES == "processes":
        seen = different > 0
    else:
        # The finding is about the last call, or about values read up to it.
        seen = different == 0 and last
    if left_out and not last:
        print("FMPy cannot make the last call.")
    print("fmu check found:" if seen else "Not seen here; fmu check found:", *EVIDENCE, sep="\n  ")
    sys.exit(0 if seen else 1)


main()
