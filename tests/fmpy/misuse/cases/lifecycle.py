"""Every function in every state, and the ways out of an error."""

import ctypes as c

from ..abi import DISCARD, ERROR, OK, REAL
from ..case import case
from ..run import alone, excite, recovers, refused, run
from ..signatures import DERIVATIVES, FUNCTIONS, UNSUPPORTED

STATES = "INSTE"  # instantiated, initialization, step, terminated, error

# Where each call is allowed (tables of FMI 2.0.5, 4.2.4 and FMI 3.0.2, 2.3 and 4.2). After an error: get, reset, states, free.
ALLOWED = {
    "SetDebugLogging": "INSTE",
    "EnterInitializationMode": "I",
    "ExitInitializationMode": "N",
    "Terminate": "S",
    "Reset": "INSTE",
    "DoStep": "S",
    "GetReal": {2: "NSTE", 3: "INSTE"},
    "GetInteger": {2: "NSTE", 3: "INSTE"},
    "SetInput": "INS",
    "SetParameter": "IN",
    "SaveState": "INST",
    "RestoreState": "INSTE",
    "SerializeState": "INSTE",
    "FreeState": "INSTE",
    "SetupExperiment": {2: "I"},
    "GetRealStatus": {2: "S"},
}
UNSAID = {(2, "GetRealStatus", "T")}  # tools and texts differ; either is fine


def reach(fmu, state):
    """A fresh instance in one of the states."""
    it = fmu.instance()
    if state == "N":
        it.enter()
    elif state != "I":
        run(it.begin(), 3)
        if state == "T":
            assert it.call("Terminate") == OK
        elif state == "E":
            it.fail()
    it.messages.clear()
    return it


def perform(it, call, saved):
    """Makes a call with valid arguments; the status."""
    fmu = it.fmu
    parameter = next(v for v in fmu.of("parameter") if v.variability == "fixed" and v.type == REAL[it.version] and float(v.start))
    match call:
        case "SetDebugLogging":
            return it.call(call, 1, 0, None)
        case "EnterInitializationMode" if it.version == 2:
            if it.call("SetupExperiment", 0, 0.0, 0.0, 0, 0.0) != OK:
                it.messages.clear()
            return it.call(call)
        case "EnterInitializationMode" | "SetupExperiment":
            return it.call(call, 0, 0.0, 0.0, 0, 0.0)
        case "DoStep":
            return it.step()
        case "GetReal":
            references = [v.reference for v in fmu.of("output")]
            return it.access("Get", "Real" if it.version == 2 else "Float64", references, (c.c_double * len(references))())
        case "GetInteger":
            reference = [fmu.find("motor.n_p").reference]
            return it.access("Get", "Integer" if it.version == 2 else "Int32", reference, (c.c_int32 * 1)())
        case "SetInput":
            return it.set(fmu.of("input")[0].name, 1.5)
        case "SetParameter":
            return it.set(parameter.name, 1.1 * float(parameter.start))
        case "SaveState":
            state = c.c_void_p()
            return it.state_call("GetFMUState", c.byref(state))
        case "RestoreState":
            return it.restore(saved)
        case "SerializeState":
            size = c.c_size_t()
            return it.state_call("SerializedFMUStateSize", saved, c.byref(size))
        case "FreeState":
            return it.forget(c.c_void_p())
        case "GetRealStatus":
            return it.call(call, 2, c.byref(c.c_double()))
        case _:
            return it.call(call)


@case
def every_call_in_every_state(fmu):
    """Allowed: OK. Not allowed: Error with a message, after which only get, reset, states and free are allowed."""
    trace, saved = alone(fmu, 10), reach(fmu, "S").save()
    for call, where in ALLOWED.items():
        where = where.get(fmu.version) if isinstance(where, dict) else where
        if where is None:
            continue
        for state in STATES:
            it = reach(fmu, state)
            status = perform(it, call, saved)
            if (fmu.version, call, state) in UNSAID:
                continue
            try:
                if state in where:
                    assert status == OK and not it.errors(), (status, it.messages)
                else:
                    refused(it, status)
                recovers(it, trace)
            except AssertionError as error:
                raise AssertionError(f"{call} in state {state}: {error}") from error
            it.free()


@case
def unsupported_functions(fmu):
    """Functions that the FMU does not support are refused in every state, with null arrays and with arrays."""
    assert set(UNSUPPORTED[fmu.version]) <= set(FUNCTIONS[fmu.version])
    trace, room = alone(fmu, 10), (c.c_uint8 * 256)()
    reference = fmu.of("output")[0].reference
    (c.c_uint32 * 1).from_buffer(room)[0] = reference
    states = any(name.startswith("der(") for name in fmu.variables)
    for name in UNSUPPORTED[fmu.version]:
        if states and name in DERIVATIVES:
            continue
        function, letters = getattr(fmu.library, name), FUNCTIONS[fmu.version][name][1:]
        for state in STATES:
            for values in ({"p": None, "n": 0}, {"p": room, "n": 1}):
                it = reach(fmu, state)
                values = {"d": 0.0, "u": reference, "i": 0, "b": 0, **values}
                status = function(it.handle, *(values[letter] for letter in letters))
                try:
                    refused(it, status)
                    recovers(it, trace)
                except AssertionError as error:
                    raise AssertionError(f"{name} in state {state}: {error}") from error
                it.free()


@case
def status_functions(fmu):
    """FMI 2.0: a synchronous FMU reports its time; other requests give Discard, without an error."""
    if fmu.version == 3:
        return
    it = fmu.instance().begin()
    run(it, 7)
    time, flag, number, text = c.c_double(), c.c_int(-1), c.c_int(), c.c_char_p()
    assert it.call("GetRealStatus", 2, c.byref(time)) == OK
    assert time.value == it.t
    assert it.call("GetBooleanStatus", 3, c.byref(flag)) == OK
    assert flag.value == 0
    assert it.call("GetStringStatus", 1, c.byref(text)) in (OK, DISCARD)
    assert it.call("GetStatus", 0, c.byref(number)) in (OK, DISCARD)
    for kind in (-1, 3, 99):
        assert it.call("GetIntegerStatus", kind, c.byref(number)) == DISCARD
    assert it.call("GetRealStatus", 0, c.byref(time)) == DISCARD
    assert it.call("GetStringStatus", 99, c.byref(text)) == DISCARD
    assert not it.errors()
    assert it.step() == OK


@case
def double_terminate(fmu):
    """Once is enough."""
    it = reach(fmu, "T")
    refused(it, it.call("Terminate"))


@case
def last_values_after_terminate(fmu):
    """Outputs stay readable."""
    it = fmu.instance().begin()
    run(it, 5)
    before = it.reals("Get", fmu.of("output"))
    assert it.call("Terminate") == OK
    assert it.reals("Get", fmu.of("output")) == before


@case
def free_in_every_state(fmu):
    """And free of null."""
    for state in STATES:
        reach(fmu, state).free()
    fmu.function("FreeInstance")(None)


@case
def skipped_steps_of_life(fmu):
    """Initialization omitted, incomplete, done twice; FMI 2.0 without times."""
    refused(it := fmu.instance(), it.step())
    refused(it := fmu.instance().enter(), it.step())
    refused(it := fmu.instance(), it.call("ExitInitializationMode"))
    refused(it := fmu.instance().begin(), it.call("ExitInitializationMode"))
    refused(it := fmu.instance().begin(), it.set_up())
    if fmu.version == 2:
        refused(it := fmu.instance(), it.call("EnterInitializationMode"), "fmi2SetupExperiment")
        refused(it := fmu.instance().enter(), it.call("EnterInitializationMode"))
    else:
        refused(it := fmu.instance().enter(), it.set_up())


@case
def reset_from_every_state(fmu):
    """A reset gives the first run again, regardless of the values set and of the start time."""
    trace = alone(fmu)
    for state in STATES:
        it = reach(fmu, state)
        if state in "IN":
            excite(it, 17)
        if state == "I":
            # Plant and controller of a drive have the same pole pairs.
            for name in [v.name for v in fmu.settable() if v.name.endswith("motor.n_p")]:
                assert it.set(name, 5) == OK
            run(it.begin(start=12.5), 10)
        recovers(it, trace)
        recovers(it, trace)


@case
def error_is_final(fmu):
    """After an error, every call except the ways out fails, repeatedly, and changes nothing."""
    it = fmu.instance().begin()
    run(it, 5)
    outputs = it.reals("Get", fmu.of("output"))
    it.fail()
    for _ in range(3):
        assert it.step() == ERROR
        assert it.set(fmu.of("input")[0].name, 1.0) == ERROR
        assert it.call("Terminate") == ERROR
        assert it.call("ExitInitializationMode") == ERROR
        assert it.set_up() == ERROR
    assert it.reals("Get", fmu.of("output")) == outputs


@case
def initialization_is_iterated(fmu):
    """Sets and gets in any order give the same as a single set."""
    parameter = (fmu.find("initial.theta_e") or fmu.find("initial.theta_est")).name
    output = parameter.rsplit(".", 1)[-1]
    it = fmu.instance().enter()
    for value in (0.5, -1.0, 0.25):
        assert it.set(parameter, value) == OK
        found = it.get(output)[0]
        assert abs(found - value) < 1e-12, (found, value)
    assert it.call("ExitInitializationMode") == OK
    once = fmu.instance()
    assert once.set(parameter, 0.25) == OK
    assert run(it) == run(once.begin())
