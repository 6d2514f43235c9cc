"""Many instances, one after another, side by side, in several threads."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

from ..abi import OK
from ..case import case
from ..run import alone, run


@case
def two_interleaved(fmu):
    """Stepped in turn, with different parameters: each gives the same as alone."""
    plain, flux = alone(fmu), fmu.find("motor.psi_M").name
    one, two = fmu.instance(b"one"), fmu.instance(b"two")
    assert two.set(flux, 0.1) == OK
    one.begin(), two.begin(start=3.0)
    first = second = b""
    for _ in range(60):
        first += run(one, 1)
        second += run(two, 1)
    assert first == plain
    lone = fmu.instance()
    assert lone.set(flux, 0.1) == OK
    assert second == run(lone.begin()) != plain


@case
def a_hundred(fmu):
    """A hundred at once, stepped in turn, freed in another order, some in error."""
    plain = alone(fmu, 20)
    all_of_them = [fmu.instance(b"%d" % n).begin() for n in range(100)]
    traces = [b""] * 100
    for step in range(20):
        for n, it in enumerate(all_of_them):
            if n % 10 == 9:
                if step == n // 10:
                    it.fail()
            else:
                traces[n] += run(it, 1)
    assert all(trace == plain for n, trace in enumerate(traces) if n % 10 != 9)
    for it in all_of_them[::3] + all_of_them[1::3] + all_of_them[2::3]:
        it.free()


@case
def in_threads(fmu):
    """Eight threads with an instance each, at the same time, with saved states."""
    plain = alone(fmu)

    def work(_):
        it = fmu.instance().begin()
        trace = run(it, 30)
        state = it.save()
        data = it.store(state)
        assert it.restore(it.recall(data)[1]) == OK
        return trace + run(it, 30)

    with ThreadPoolExecutor(8) as pool:
        assert all(trace == plain for trace in pool.map(work, range(32)))


@case
def through_threads(fmu):
    """Created in one thread, run in others one after another, freed in yet another."""
    plain, it, traces = alone(fmu), [], []
    for work in (
        lambda: it.append(fmu.instance()),
        lambda: it[0].begin(),
        *[lambda: traces.append(run(it[0], 20))] * 3,
        lambda: it[0].free(),
    ):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert b"".join(traces) == plain


@case
def small_stack(fmu):
    """A complete run on a stack of 128 KiB; of 512 KiB with AddressSanitizer, which surrounds every variable."""
    traces, before = [], threading.stack_size((512 if "FMU_ASAN" in os.environ else 128) * 1024)
    thread = threading.Thread(target=lambda: traces.append(alone(fmu)))
    thread.start()
    thread.join()
    threading.stack_size(before)
    assert traces == [alone(fmu)]


@case
def one_fails(fmu):
    """An error, a reset or a restored state of one instance does not affect another."""
    plain = alone(fmu)
    good, bad = fmu.instance(b"good").begin(), fmu.instance(b"bad").begin()
    trace = run(good, 20)
    state = bad.save()
    bad.fail()
    trace += run(good, 20)
    assert bad.restore(state) == OK
    assert bad.call("Reset") == OK
    bad.free()
    assert trace + run(good, 20) == plain
    assert not good.errors()


@case
def same_name(fmu):
    """Several instances may have the same name."""
    plain = alone(fmu, 20)
    one, two = fmu.instance().begin(), fmu.instance().begin()
    assert run(one, 20) == plain == run(two, 20)


@case
def deterministic(fmu):
    """The same run, ten times."""
    assert len({alone(fmu) for _ in range(10)}) == 1
