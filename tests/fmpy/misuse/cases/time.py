"""Invalid steps and times."""

import math
import time as clock

from ..abi import ERROR, OK
from ..case import case
from ..run import alone, excite, recovers, refused, run

H = 1e-4


@case
def step_sizes(fmu):
    """Zero, negative, NaN, infinite, below the resolution: an error at once."""
    trace = alone(fmu, 10)
    for h in (0.0, -0.0, -H, math.nan, math.inf, -math.inf, 5e-324, -5e-324, 1e-310):
        it = fmu.instance().begin()
        run(it, 5)
        before = it.reals("Get", fmu.of("output"))
        refused(it, it.step(h), "communicationStepSize")
        assert it.reals("Get", fmu.of("output")) == before
        recovers(it, trace)
        it.free()


@case
def huge_steps(fmu):
    """Extremely long: refused at once; longer than usual: done or refused, in bounded time."""
    trace = alone(fmu, 10)
    for h in (1e9, 1e15, 1e300, 1.7e308):
        it = fmu.instance().begin()
        began = clock.thread_time()
        status = it.step(h)
        took = clock.thread_time() - began
        assert took < 1, f"a step of {h} s took {took} s of this thread"
        refused(it, status)
        recovers(it, trace)
        it.free()
    it = fmu.instance().begin()
    assert it.step(10.0) in (OK, ERROR)
    recovers(it, trace)


@case
def a_step_below_the_resolution_of_time(fmu):
    """Time must advance: t + h = t is refused."""
    it = fmu.instance().begin(start=1e9)
    refused(it, it.step(1e-9))


@case
def communication_points(fmu):
    """A step begins where the last one ended, to a hundredth of its size."""
    trace = alone(fmu, 10)
    for offset in (H, -H, H / 50, -H / 50, 1.0, math.nan, math.inf, -math.inf, 1e308):
        it = fmu.instance().begin()
        run(it, 5)
        before = it.reals("Get", fmu.of("output"))
        refused(it, it.step(H, t=it.t + offset), "currentCommunicationPoint")
        assert it.reals("Get", fmu.of("output")) == before
        recovers(it, trace)
        it.free()
    for offset in (H / 200, -H / 200):
        it = fmu.instance().begin()
        run(it, 5)
        assert it.step(H, t=it.t + offset) == OK


@case
def first_communication_point(fmu):
    """The first step begins at the start time."""
    for start in (0.0, 3.0, -2.0):
        it = fmu.instance().begin(start)
        refused(it, it.step(H, t=start + 2 * H))
        it.free()


@case
def stop_time(fmu):
    """Steps up to the stop time, with rounding, and not beyond; the last step may be shorter."""
    for start in (0.0, 7.3):
        it = fmu.instance().begin(start, start + 10 * H)
        run(it, 10)
        refused(it, it.step(H), "stop")
        it = fmu.instance().begin(start, start + 10 * H)
        run(it, 9)
        refused(it, it.step(1.001 * H), "stop")
        it = fmu.instance().begin(start, start + 9.5 * H)
        run(it, 9)
        assert it.step(start + 9.5 * H - it.t) == OK


@case
def many_steps_to_the_stop_time(fmu):
    """Time summed up by the importer drifts, and still reaches the stop time."""
    it = fmu.instance().begin(0.0, 10.0)
    for _ in range(100_000):
        assert it.step(H) == OK, it.messages
    refused(it, it.step(H), "stop")


@case
def experiments(fmu):
    """Invalid start and stop times."""
    for start in (math.nan, math.inf, -math.inf):
        refused(it := fmu.instance(), it.set_up(start), "startTime")
    for stop in (math.nan, math.inf, 0.5, 1.0):
        refused(it := fmu.instance(), it.set_up(1.0, stop), "stopTime")


@case
def tolerances(fmu):
    """A fixed-step FMU ignores the tolerance: no value changes anything."""
    trace = alone(fmu, 10)
    for defined, tolerance in ((0, math.nan), (1, 1e-6), (0, -1.0)):
        it = fmu.instance()
        name = "SetupExperiment" if fmu.version == 2 else "EnterInitializationMode"
        assert it.call(name, defined, tolerance, 0.0, 0, math.nan) == OK, it.messages
        assert fmu.version == 3 or it.call("EnterInitializationMode") == OK
        assert it.call("ExitInitializationMode") == OK
        assert run(it, 10) == trace
        it.free()


@case
def start_times(fmu):
    """The trajectory does not depend on when it starts, as long as time resolves a step."""
    trace = alone(fmu)
    for start in (-5.0, 0.5, 86_400.0, 1e6):
        it = fmu.instance().begin(start)
        assert run(it) == trace, f"start at {start} s"
        it.free()


@case
def time_after_a_step(fmu):
    """The last communication point is t + h as the importer computes it: FMI 3.0 also returns it as a result of the
    step."""
    for start in (0.0, -1.0, 12.3):
        it = fmu.instance().begin(start)
        assert it.time() == (OK, start)
        for h in (H, H / 3, 3 * H, 0.7 * H):
            t = it.t
            assert it.step(h) == OK
            assert it.time() == (OK, t + h)
            if fmu.version == 3:
                assert list(it.flags) == [0, 0, 0]
                assert it.reached.value == t + h


@case
def random_step_sizes(fmu):
    """A step from 1e-9 s to 1e-2 s after any other: no error, no NaN."""
    it, seed = fmu.instance().begin(), 1
    for k in range(3000):
        seed = seed * 16807 % 2147483647
        excite(it, k)
        assert it.step(10 ** (-9 + 7 * seed / 2147483647)) == OK, it.messages
    assert all(math.isfinite(x) for x in it.get(*(v.name for v in fmu.of("output"))))
