"""Null pointers, wrong tokens, empty names: wrong arguments of instantiation and of every call."""

import ctypes as c

from ..abi import DISCARD, ENVIRONMENT, ERROR, OK, REAL, Instance
from ..case import case
from ..run import recovers, refused, run
from ..signatures import ALL, FUNCTIONS, RETURNS


def nothing(letters):
    """Zeros and null pointers for a list of arguments."""
    return [None if letter == "p" else 0 for letter in letters]


@case
def null_instance(fmu):
    """Every function of both standards with zeros only."""
    for name, letters in ALL.items():
        result = getattr(fmu.library, name)(*nothing(letters))
        match RETURNS.get(name, "status"):
            case "status":
                assert result == ERROR, (name, result)
            case "instance" | "nothing":
                assert result is None, name


@case
def versions(fmu):
    """Both standards answer from the same binary."""
    assert fmu.library.fmi2GetVersion() == b"2.0"
    assert fmu.library.fmi3GetVersion() == b"3.0"
    assert fmu.library.fmi2GetTypesPlatform() == b"default"


@case
def null_arguments(fmu):
    """A valid instance in Step Mode, with null for every pointer and 1 for every count."""
    trace = run(fmu.instance().begin(), 20)
    for name, letters in FUNCTIONS[fmu.version].items():
        pointers = letters.count("p") - letters.startswith("p")
        if name in RETURNS or "Instantiate" in name or pointers == 0:
            continue
        it = fmu.instance().begin()
        rest = [1 if letter == "n" else value for letter, value in zip(letters[1:], nothing(letters[1:]))]
        status = getattr(fmu.library, name)(it.handle, *rest)
        if "FreeFMU" in name:  # freeing null does nothing, as in C
            assert status == OK, name
        elif name.endswith("Status"):
            assert status in (DISCARD, ERROR), name
        else:
            refused(it, status)
        recovers(it, trace)
        it.free()


@case
def null_arrays_of_nothing(fmu):
    """A call for no values is allowed, even without arrays."""
    it = fmu.instance().begin()
    size = (0,) if fmu.version == 3 else ()
    for suffix in ("Real", "Integer", "Boolean", "String") if fmu.version == 2 else ("Float64", "Int32", "Boolean", "String"):
        for way in ("Get", "Set"):
            assert it.call(way + suffix, None, 0, None, *size) == OK, way + suffix
    assert it.step() == OK


@case
def null_half(fmu):
    """References without values, values without references."""
    references, values = (c.c_uint32 * 1)(fmu.of("input")[0].reference), (c.c_double * 1)()
    size = (1,) if fmu.version == 3 else ()
    for way in ("Get", "Set"):
        for arrays in ((references, 1, None), (None, 1, values)):
            it = fmu.instance().begin()
            refused(it, it.call(way + REAL[fmu.version], *arrays, *size))
            it.free()


@case
def null_out_pointers_of_a_step(fmu):
    """FMI 3.0: each of the four results of a step is missing in turn."""
    if fmu.version == 2:
        return
    for missing in range(4):
        it = fmu.instance().begin()
        flags, reached = (c.c_uint8 * 3)(), c.c_double()
        out = [*(c.byref(flags, i) for i in range(3)), c.byref(reached)]
        out[missing] = None
        refused(it, it.call("DoStep", 0.0, 1e-4, 1, *out))


@case
def numbers_of_values(fmu):
    """FMI 3.0: more or fewer values than references; nothing is written, inside or outside the array."""
    if fmu.version == 2:
        return
    outputs = fmu.of("output")
    references = (c.c_uint32 * len(outputs))(*(v.reference for v in outputs))
    for count in (0, len(outputs) - 1, len(outputs) + 1, 2**62):
        it = fmu.instance().begin()
        values = (c.c_double * (len(outputs) + 2))(*([7.25] * (len(outputs) + 2)))
        refused(it, it.call("GetFloat64", references, len(outputs), values, count))
        assert list(values) == [7.25] * len(values), "a refused get wrote"
        it.free()
    inputs = fmu.of("input")
    references = (c.c_uint32 * len(inputs))(*(v.reference for v in inputs))
    for count in (0, len(inputs) - 1, len(inputs) + 1):
        it = fmu.instance().begin()
        before = it.reals("Get", inputs)
        refused(it, it.call("SetFloat64", references, len(inputs), (c.c_double * 20)(*([3.0] * 20)), count))
        assert it.reals("Get", inputs) == before, "a refused set wrote"
        it.free()


def refusal(fmu, *words, name=b"it", **arguments):
    """An instantiation that must fail with one message that says why."""
    it = Instance(fmu, name, **arguments)
    assert it.handle is None, f"instantiated with {name!r}, {arguments}"
    assert len(it.errors()) == 1, it.messages
    for word in words:
        assert word.lower() in it.errors()[0].lower(), (word, it.errors())


@case
def wrong_token(fmu):
    """A wrong token, none, an empty one, a longer one; the message shows both tokens where there are two."""
    word = "guid" if fmu.version == 2 else "token"
    wrong = "{00000000-0000-0000-0000-000000000000}"
    refusal(fmu, word, wrong, fmu.token, token=wrong.encode())
    refusal(fmu, word, token=fmu.token.encode() + b" ")
    refusal(fmu, word, token=fmu.token.encode()[:-1])
    refusal(fmu, word, token=b"\xff\xfe")
    refusal(fmu, word, token=c.create_string_buffer(b""))
    refusal(fmu, word, token=b"")  # passed as NULL


@case
def wrong_name(fmu):
    """No name, an empty one, blanks."""
    for name in (None, b"", b"  \t"):
        refusal(fmu, "name", name=name)


@case
def wrong_kind(fmu):
    """A type that does not exist, Event Mode where it is not supported, scheduled execution."""
    if fmu.version == 2:
        refusal(fmu, "fmuType", "fmi2CoSimulation", "fmi2ModelExchange", type=17)
        refusal(fmu, "fmuType", type=-1)
        return
    if fmu.identifier != "SensorlessController":
        refusal(fmu, "event", events=True)
    it = fmu.instance()
    create = fmu.function("InstantiateScheduledExecution")
    logger = c.cast(it.logger, c.c_void_p)
    assert create(b"it", fmu.token.encode(), None, 0, 1, ENVIRONMENT, logger, None, None, None) is None
    assert len(it.errors()) == 1, it.messages


def exchange(fmu):
    """A handle of an instance for Model Exchange in Event Mode, and a call of one of its functions."""
    it = fmu.instance()
    logger = c.cast(it.logger, c.c_void_p)
    if fmu.version == 2:
        it = Instance(fmu, b"it", type=0)
        handle = it.handle
        assert it.call("SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
        enter = fmu.function("EnterInitializationMode")
        assert enter(handle) == OK
    else:
        handle = fmu.function("InstantiateModelExchange")(b"it", fmu.token.encode(), None, 0, 0, ENVIRONMENT, logger)
        assert fmu.function("EnterInitializationMode")(handle, 0, 0.0, 0.0, 0, 0.0) == OK
    assert fmu.function("ExitInitializationMode")(handle) == OK
    return it, handle


@case
def nonsense_in_model_exchange(fmu):
    """Null pointers, wrong counts, NaN: an Error or Discard, never a crash; a reset recovers the instance."""
    it, handle = exchange(fmu)
    derivatives = "GetDerivatives" if fmu.version == 2 else "GetContinuousStateDerivatives"
    states, nan, room = fmu.states, float("nan"), (c.c_double * 16)()

    def begin():
        assert fmu.function("Reset")(handle) == OK
        if fmu.version == 2:
            assert fmu.function("SetupExperiment")(handle, 0, 0.0, 0.0, 0, 0.0) == OK
            assert fmu.function("EnterInitializationMode")(handle) == OK
        else:
            assert fmu.function("EnterInitializationMode")(handle, 0, 0.0, 0.0, 0, 0.0) == OK
        assert fmu.function("ExitInitializationMode")(handle) == OK
        assert fmu.function("EnterContinuousTimeMode")(handle) == OK

    for name in (derivatives, "GetContinuousStates", "SetContinuousStates", "GetNominalsOfContinuousStates"):
        for pointer, count in ((None, states + 1), (room, states + 1), (None, 2**62), (room, states + 3)):
            begin()
            assert fmu.function(name)(handle, pointer, count) == ERROR, (name, count)
    for time in (nan, float("inf"), -1.0):
        begin()
        assert fmu.function("SetTime")(handle, c.c_double(time)) == ERROR, time
    begin()
    for bad in (nan, float("inf"), -float("inf")) if states else ():
        before, after = ((c.c_double * states)() for _ in range(2))
        assert fmu.function("GetContinuousStates")(handle, before, states) == OK
        wrong = (c.c_double * states)(0.1, bad, *[1.0] * (states - 2))
        assert fmu.function("SetContinuousStates")(handle, wrong, states) == DISCARD
        assert fmu.function("GetContinuousStates")(handle, after, states) == OK
        assert list(before) == list(after)
    assert fmu.function("SetTime")(handle, c.c_double(1e-5)) == OK
    fmu.function("FreeInstance")(handle)
    it.handle = None
    run(fmu.instance().begin(), 10)
