"""Saved states: complete, reusable, exchangeable; foreign pointers are refused."""

import ctypes as c

from ..abi import ERROR, OK
from ..case import case
from ..run import alone, excite, recovers, refused, run
from .lifecycle import reach

NOT_OURS = (1, 7, 0xDEAD_BEEF, 2**47 - 8, 2**63, 2**64 - 1)


@case
def state_continues(fmu):
    """Save, continue, restore, continue: the same bits, twice from the same state, and the same as without saving."""
    it = fmu.instance().begin()
    first, k, t = run(it, 30), it.k, it.t
    state = it.save()
    on = run(it, 30)
    assert first + on == alone(fmu)
    for _ in range(2):
        assert it.restore(state) == OK
        it.k, it.t = k, t
        assert it.time() == (OK, t)
        assert run(it, 30) == on
    assert it.forget(state) == OK
    assert not state.value


@case
def state_in_every_state(fmu):
    """A state also restores the mode of the instance."""
    trace = alone(fmu, 20)
    for where in "INST":
        it = reach(fmu, where)
        state = it.save()
        for elsewhere in "INSTE":
            other = reach(fmu, elsewhere)
            assert other.restore(state) == OK, (where, elsewhere, other.messages)
            match where:
                case "I":
                    assert run(other.begin(), 20) == trace
                case "N":
                    assert other.call("ExitInitializationMode") == OK
                    other.t, other.k = 0.0, 0
                    assert run(other, 20) == trace
                case "S":
                    other.t, other.k = it.t, it.k
                    assert trace.endswith(run(other, 17))
                case "T":
                    refused(other, other.call("Terminate"))
            other.free()
        assert it.forget(state) == OK
        it.free()


@case
def state_holds_parameters_and_inputs(fmu):
    """A state restores the values set before it, and drops those set after it."""
    it, resistance = fmu.instance(), fmu.find("motor.R_s").name
    assert it.set(resistance, 1.5) == OK
    it.begin()
    excite(it, 3)
    inputs = it.reals("Get", fmu.of("input"))
    state = it.save()
    other = fmu.instance().begin()
    run(other, 5)
    assert other.restore(state) == OK
    assert other.get(resistance) == [1.5]
    assert other.reals("Get", fmu.of("input")) == inputs
    it.free()  # the state outlives the instance that created it
    other.t = other.k = 0
    assert run(other, 10) != alone(fmu, 10)
    assert other.forget(state) == OK


@case
def state_of_another_instance(fmu):
    """Another instance continues from a saved state, bit for bit."""
    it, other = fmu.instance().begin(), fmu.instance(b"other").begin(start=5.0)
    run(it, 30), run(other, 7)
    state, other.t, other.k = it.save(), it.t, it.k
    assert other.restore(state) == OK
    assert run(other, 30) == run(it, 30)


@case
def state_leads_out_of_an_error(fmu):
    """Restore after an error: the run continues as if the error had not happened."""
    it = fmu.instance().begin()
    run(it, 30)
    state, k, t = it.save(), it.k, it.t
    on = run(it, 30)
    it.fail()
    refused(it, it.state_call("GetFMUState", c.byref(c.c_void_p())))
    assert it.restore(state) == OK
    it.k, it.t = k, t
    assert run(it, 30) == on


@case
def state_is_overwritten(fmu):
    """Get into a state that exists: the same state with new content."""
    it = fmu.instance().begin()
    state = it.save()
    before, again = state.value, run(it, 10)
    assert it.state_call("GetFMUState", c.byref(state)) == OK
    assert state.value == before
    k, t, on = it.k, it.t, run(it, 10)
    assert it.restore(state) == OK
    it.k, it.t = k, t
    assert run(it, 10) == on != again


@case
def state_pointers_that_are_not_ours(fmu):
    """Null, garbage, the instance itself, a buffer: an error for every function that takes a state."""
    trace, buffer = alone(fmu, 10), (c.c_uint8 * 4096)()
    it = fmu.instance().begin()
    for pointer in (None, *NOT_OURS, it.handle, c.addressof(buffer), c.cast(it.logger, c.c_void_p).value):
        for what in ("set", "size", "serialize", "free", "get"):
            if pointer is None and what in ("free", "get"):
                continue
            match what:
                case "set":
                    status = it.restore(pointer)
                case "size":
                    status = it.state_call("SerializedFMUStateSize", pointer, c.byref(c.c_size_t()))
                case "serialize":
                    status = it.state_call("SerializeFMUState", pointer, buffer, len(buffer))
                case "free":
                    status = it.forget(c.c_void_p(pointer))
                case "get":
                    status = it.state_call("GetFMUState", c.byref(c.c_void_p(pointer)))
            try:
                refused(it, status)
            except AssertionError as error:
                raise AssertionError(f"{what} with {pointer!r}: {error}") from error
            recovers(it, trace)


@case
def state_freed(fmu):
    """A copy of a freed pointer is refused everywhere; the pointer itself is null and may be freed again."""
    it = fmu.instance().begin()
    state = it.save()
    copy = c.c_void_p(state.value)
    assert it.forget(state) == OK
    assert state.value is None
    assert it.forget(state) == OK
    assert it.state_call("FreeFMUState", None) == OK
    for call in (
        lambda: it.restore(copy),
        lambda: it.forget(copy),
        lambda: it.state_call("SerializedFMUStateSize", copy, c.byref(c.c_size_t())),
    ):
        assert call() == ERROR
    fresh = fmu.instance().begin().save()
    assert fresh.value != copy.value, "a handle was given twice"


@case
def state_cost(fmu):
    """Ten thousand states, saved and freed in any order, and some left behind."""
    it = fmu.instance().begin()
    states = [it.save() for _ in range(10_000)]
    assert len({state.value for state in states}) == len(states)
    run(it, 5)
    assert it.restore(states[5000]) == OK
    for state in states[::2] + states[1:9000:2]:
        assert it.forget(state) == OK
    it.t, it.k = 0.0, 0
    assert run(it, 10) == alone(fmu, 10)


@case
def state_does_not_disturb(fmu):
    """Saving at every step changes nothing."""
    it, trace, state = fmu.instance().begin(), b"", c.c_void_p()
    for _ in range(60):
        assert it.state_call("GetFMUState", c.byref(state)) == OK
        trace += run(it, 1)
    assert trace == alone(fmu)
    recovers(it, trace)
