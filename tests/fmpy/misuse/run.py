"""The common run of the cases: it excites every input and returns all outputs, bit for bit."""

import math

from .abi import ERROR, OK

SWING = 20.0  # V, A, rad/s or N.m: enough to turn the rotor and to move the estimate


def excite(it, k):
    """Sets every real input, except those with a range of one sign, to a different sine at step `k`."""
    inputs = [v for v in it.fmu.of("input") if not v.name.startswith(("u_dc", "T_", "tau_limit_"))]
    it.reals("Set", inputs, [SWING * math.sin(0.01 * k * (n + 2) + n) for n in range(len(inputs))])


def run(it, steps=60, h=1e-4):
    """Steps on and returns the outputs after every step as bytes."""
    trace = []
    for _ in range(steps):
        excite(it, it.k)
        assert it.step(h) == OK, it.messages
        it.k += 1
        trace.append(it.reals("Get", it.fmu.of("output")))
    return b"".join(trace)


def alone(fmu, steps=60):
    """The run of a fresh instance."""
    it = fmu.instance().begin()
    trace = run(it, steps)
    it.free()
    return trace


def refused(it, status, *words):
    """A call was refused properly: Error, with at least one message, all `words` in the messages, and no further
    step."""
    assert status == ERROR, f"status {status} instead of {ERROR}; log: {it.messages}"
    assert it.errors(), "an error without a message"
    text = it.errors()[-1]
    for word in words:
        assert word in text, f"{word!r} is missing in {text!r}"
    assert it.step() == ERROR, "a step after an error"


def recovers(it, trace):
    """After any misuse, a reset gives the first run again, bit for bit."""
    assert it.call("Reset") == OK, it.messages
    it.messages.clear()
    assert run(it.begin(), len(trace) // (8 * len(it.fmu.of("output")))) == trace, "the run after a reset differs"
