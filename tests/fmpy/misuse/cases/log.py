"""Messages: which ones are logged, and to which logger."""

import ctypes as c

from ..abi import ENVIRONMENT, ERROR, OK, Instance
from ..case import case
from ..run import recovers, refused, run


def categories(*names):
    """An array of C strings."""
    return (c.c_char_p * len(names))(*names)


@case
def silent_without_logging(fmu):
    """loggingOn = false: a complete run without a message; an error is still logged, once."""
    it = fmu.instance(logging=False).begin()
    run(it)
    it.forget(it.save())
    assert it.call("Terminate") == OK
    assert it.call("Reset") == OK
    assert it.messages == []
    run(it.begin(), 5)
    assert it.step(0.0) == ERROR
    assert [m.status for m in it.messages] == [ERROR]


@case
def environment_and_name(fmu):
    """The environment pointer is passed back unchanged; FMI 2.0 also names the instance, from a copy."""
    name = c.create_string_buffer(b"Antrieb 1")
    it = Instance(fmu, c.addressof(name) if fmu.version == 3 else c.cast(name, c.c_void_p))
    c.memset(name, 0xDD, len(name))
    run(it.begin(), 5)
    it.fail()
    assert it.messages
    assert all(m.environment == ENVIRONMENT for m in it.messages)
    if fmu.version == 2:
        assert {m.name for m in it.messages} == {"Antrieb 1"}


@case
def callbacks_overwritten(fmu):
    """FMI 2.0: the importer may change the struct after instantiation."""
    if fmu.version == 3:
        return
    it = fmu.instance()
    c.memset(c.byref(it.callbacks), 0xDD, c.sizeof(it.callbacks))
    trace = run(it.begin())
    it.fail()
    assert it.errors()
    recovers(it, trace)


@case
def token_overwritten(fmu):
    """The importer may change token and resource location after instantiation."""
    token, place = c.create_string_buffer(fmu.token.encode()), c.create_string_buffer(b"file:///tmp/resources")
    it = Instance(fmu, b"it", token=token, resources=c.cast(place, c.c_void_p))
    assert it.handle, it.messages
    c.memset(token, 0xDD, len(token)), c.memset(place, 0xDD, len(place))
    trace = run(it.begin())
    recovers(it, trace)


@case
def categories_of_the_xml(fmu):
    """Only categories that the XML lists, and errors and warnings in theirs; one line of UTF-8, without format
    specifiers."""
    it = fmu.instance(b"50 %s #1")
    run(it.begin(), 5)
    state = it.save()
    for provoke in (
        lambda: it.step(0.0),
        lambda: it.restore(None),
        lambda: it.set(fmu.of("input")[0].name, float("nan")),
        lambda: it.call("ExitInitializationMode"),
        lambda: it.call("SetDebugLogging", 1, 1, categories(b"no such % category #1")),
    ):
        assert it.restore(state) == OK
        assert provoke() == ERROR
    assert len(it.messages) > 5
    assert fmu.categories
    for m in it.messages:
        assert m.category in fmu.categories, m
        expected = {0: m.category, 1: "logStatusWarning"}.get(m.status, "logStatusError")
        assert m.category == expected, m
        assert m.text and m.text == m.text.strip() and "\n" not in m.text, m
        assert "#" not in m.text.replace("##", ""), m
        assert fmu.version == 3 or "%" not in m.text.replace("%%", ""), m


@case
def switched(fmu):
    """Off and on again, all categories or one; errors are always logged."""
    it = fmu.instance()
    assert it.call("SetDebugLogging", 0, 0, None) == OK
    it.messages.clear()
    run(it.begin(), 5)
    assert it.messages == []
    assert it.step(0.0) == ERROR
    assert it.errors()
    it.messages.clear()
    assert it.call("SetDebugLogging", 1, 0, None) == OK
    assert it.call("Reset") == OK
    run(it.begin(), 5)
    assert it.messages, "logging is on again"
    for name in sorted(fmu.categories):
        assert it.call("SetDebugLogging", 0, 1, categories(name.encode())) == OK, (name, it.messages)
    it.messages.clear()
    assert it.call("Reset") == OK
    run(it.begin(), 5)
    assert it.messages == []


@case
def unknown_category(fmu):
    """A category that does not exist, an empty one, a null pointer: refused, and the message names it."""
    for bad in (b"nonsense", b"", b"logstatuserror", b"\xff\xfe"):
        it = fmu.instance()
        refused(it, it.call("SetDebugLogging", 1, 1, categories(bad)), *([bad.decode()] if bad == b"nonsense" else []))
        it.free()
    it = fmu.instance()
    refused(it, it.call("SetDebugLogging", 1, 2, categories(b"logStatusError", None)))


@case
def every_error_is_said_once(fmu):
    """One message for one call that failed, with the function's name."""
    trace = run(fmu.instance().begin(), 10)
    for call, arguments in (("DoStep", None), ("Terminate", ()), ("ExitInitializationMode", ())):
        it = fmu.instance()
        status = it.step() if arguments is None else it.call(call, *arguments)
        assert status == ERROR
        assert len(it.messages) - len(it.errors()) <= 1
        assert len(it.errors()) == 1 and f"fmi{fmu.version}{call}" in it.errors()[0], it.messages
        recovers(it, trace)


@case
def logger_that_calls_back(fmu):
    """A logger that steps, sets, resets and frees the instance that logs: refused, no crash."""
    it = fmu.instance()
    run(it.begin(), 5)
    found, remember = [], it.messages.append

    class Sinner(list):
        def append(self, message):
            remember(message)
            if len(found) < 50:
                found.append(it.call("Reset"))
                found.append(it.step())
                it.call("FreeInstance")

    it.messages = Sinner()
    assert it.step(0.0) == ERROR
    assert found and set(found) == {ERROR}, found
    it.messages = []
    recovers(it, run(fmu.instance().begin(), 10))
