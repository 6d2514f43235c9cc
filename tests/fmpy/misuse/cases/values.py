"""Invalid value references and values, and valid ones."""

import ctypes as c
import math

from ..abi import ACCESS, OK, REAL
from ..case import case
from ..run import alone, recovers, refused, run
from ..signatures import TYPES3

NOT_NUMBERS = {"NaN": math.nan, "inf": math.inf, "-inf": -math.inf}
RANGE_WORDS = ("greater than", "at least", "less than", "at most", "finite", "Rasmussen")


def types(version):
    """Suffixes of getters and setters, each with its C type."""
    if version == 2:
        return {"Real": c.c_double, "Integer": c.c_int32, "Boolean": c.c_int32, "String": c.c_char_p}
    special = {"Boolean": c.c_uint8, "String": c.c_char_p, "Float32": c.c_float, "Float64": c.c_double}
    return {kind: special.get(kind, getattr(c, f"c_{kind.lower()}", None)) for kind in TYPES3}


@case
def unknown_references(fmu):
    """References that no variable has, alone and after a good one: nothing changes."""
    known = {v.reference for v in fmu.variables.values()}
    good = fmu.of("input")[0]
    for reference in (max(known) + 1, 2**31, 2**32 - 1):
        for way in ("Get", "Set"):
            for suffix, kind in types(fmu.version).items():
                it = fmu.instance().begin()
                refused(it, it.access(way, suffix, [reference], (kind * 1)()), str(reference))
                it.free()
        it = fmu.instance().begin()
        values = (c.c_double * 2)(3.5, 1.0)
        refused(it, it.access("Set", REAL[fmu.version], [good.reference, reference], values), str(reference))
        assert it.get(good.name) == [float(good.start)]
        it.free()


@case
def references_of_another_type(fmu):
    """Every variable through the getters and setters of all other types."""
    for variable in fmu.variables.values():
        own = ACCESS[fmu.version][variable.type][0]
        for suffix, kind in types(fmu.version).items():
            if suffix == own:
                continue
            for way in ("Get", "Set"):
                it = fmu.instance().enter()
                refused(it, it.access(way, suffix, [variable.reference], (kind * 1)()))
                it.free()


@case
def binaries_and_nothing_else(fmu):
    """FMI 3.0 binaries and clocks with a real variable's reference."""
    if fmu.version == 2:
        return
    reference = (c.c_uint32 * 1)(fmu.of("input")[0].reference)
    for way in ("Get", "Set"):
        it = fmu.instance().enter()
        refused(it, it.call(f"{way}Binary", reference, 1, (c.c_size_t * 1)(), (c.c_void_p * 1)(), 1))
        it.free()


@case
def duplicate_references(fmu):
    """Get fills both; of two sets the last counts; one refused value in the middle refuses all."""
    it, v = fmu.instance().begin(), fmu.of("input")[0]
    values = (c.c_double * 2)(4.0, 5.0)
    assert it.access("Set", REAL[fmu.version], [v.reference] * 2, values) == OK
    assert it.get(v.name) == [5.0]
    values = (c.c_double * 3)()
    assert it.access("Get", REAL[fmu.version], [v.reference] * 3, values) == OK
    assert list(values) == [5.0] * 3
    refused(it, it.access("Set", REAL[fmu.version], [v.reference] * 3, (c.c_double * 3)(6.0, math.nan, 7.0)), v.name)
    assert it.get(v.name) == [5.0]


@case
def vectors_are_set_whole_or_not_at_all(fmu):
    """One bad value at the end or in the middle of vectors of every length: nothing changes."""
    variables = fmu.of("input", "parameter")
    starts = [float(v.start) for v in variables]
    it = fmu.instance()
    for length in range(2, len(variables) + 1):
        for bad in {length // 2, length - 1}:
            values = [0.9 * start or 0.25 for start in starts[:length]]
            values[bad] = math.nan
            references = [v.reference for v in variables[:length]]
            refused(it, it.access("Set", REAL[fmu.version], references, (c.c_double * length)(*values)), variables[bad].name)
            assert it.get(*(v.name for v in variables)) == starts
            assert it.call("Reset") == OK


@case
def not_a_number(fmu):
    """NaN and infinities into every real input and parameter: refused with name, value and range; nothing changed."""
    trace = alone(fmu, 10)
    it = fmu.instance()
    for variable in fmu.of("input", "parameter"):
        for shown, value in NOT_NUMBERS.items():
            status = it.set(variable.name, value)
            refused(it, status, variable.name, shown)
            assert any(word in it.errors()[-2] for word in RANGE_WORDS), it.errors()
            assert it.get(variable.name) == [float(variable.start)]
            recovers(it, trace)
            if variable.causality == "input":
                before = it.get(variable.name)
                refused(it, it.set(variable.name, value), variable.name, shown)
                assert it.get(variable.name) == before
            assert it.call("Reset") == OK
            it.messages.clear()


@case
def out_of_range(fmu):
    """Below each minimum and above each maximum of the XML."""
    bounded = [v for v in fmu.settable() if v.min is not None or v.max is not None]
    assert len(bounded) > 5
    for variable in bounded:
        bad = [float(variable.min) - 1] if variable.min is not None else []
        bad += [float(variable.max) + 1] if variable.max is not None else []
        for value in bad:
            whole = variable.type not in ("Real", "Float64")
            it = fmu.instance()
            refused(it, it.set(variable.name, int(value) if whole else value), variable.name, str(int(value)))
            assert any(word in it.errors()[0] for word in RANGE_WORDS), it.errors()
            assert it.get(variable.name) == [float(variable.start)]
            it.free()


STRICT = ("motor.R_s", "motor.L_d", "motor.L_q", "motor.psi_M", "mechanics.J", "T_s", "rasmussen.w_n")
STRICT += ("current.bandwidth", "speed_loop.bandwidth", "speed_loop.t_is", "limit.i", "limit.i_q", "zero_speed.w_0")


@case
def zero_where_it_must_not_be(fmu):
    """A machine without resistance, a loop without bandwidth, a sample period of 0."""
    for variable in filter(None, map(fmu.find, ("motor.n_p", "mechanics.w_coulomb", *STRICT))):
        it = fmu.instance()
        refused(it, it.set(variable.name, 0), variable.name, "0")
        it.free()


@case
def enumeration_values(fmu):
    """Only values of the enumeration; the message lists them."""
    estimator = fmu.find("estimator")
    if estimator is None:
        return
    for value in (0, -1, 99, 2**31 - 1, *([2**40, -(2**63)] if fmu.version == 3 else [])):
        it = fmu.instance()
        refused(it, it.set(estimator.name, value), estimator.name, str(value), "Rasmussen")
        assert it.get(estimator.name) == [1]
        it.free()


@case
def parameters_that_do_not_fit_together(fmu):
    """Refused on leaving initialization, with both names."""
    i_0 = fmu.find("zero_speed.i_0")
    if i_0 is None:
        return
    it = fmu.instance()
    assert it.set(i_0.name, 8.0) == OK
    it.enter()
    refused(it, it.call("ExitInitializationMode"), "zero_speed.i_0", "8", "limit.i")


@case
def not_settable(fmu):
    """Outputs and time never; fixed parameters not after initialization, unless the value is the present one, which
    remains."""
    for variable in fmu.variables.values():
        if variable.causality == "input" or variable.variability == "tunable":
            continue
        it = fmu.instance().begin()
        before = it.get(variable.name)
        refused(it, it.set(variable.name, 0 if before == [1] else 1), variable.name)
        assert it.get(variable.name) == before
        it.free()
        if variable.causality != "parameter":
            it = fmu.instance().enter()
            refused(it, it.set(variable.name, 1), variable.name)
            it.free()


@case
def fixed_parameters_set_to_what_they_are(fmu):
    """Some importers write all parameters after the initialization: accepted with one warning, and the run stays the
    same."""
    trace = alone(fmu, 10)
    it = fmu.instance().begin()
    it.messages.clear()
    for v in fmu.settable():
        if v.variability == "fixed":
            assert it.set(v.name, it.get(v.name)[0]) == OK, (v.name, it.messages)
    warnings = [m for m in it.messages if m.category == "logStatusWarning"]
    assert len(warnings) == 1 and not it.errors(), it.messages
    assert run(it, 10) == trace
    it.free()


@case
def set_and_get_again(fmu):
    """Every settable variable, before and in initialization, inputs and tunable parameters in between steps: bit for bit."""
    for state in ("instantiated", "initialization", "step"):
        for v in fmu.settable():
            if state == "step" and v.variability == "fixed":
                continue
            it = fmu.instance()
            it.enter() if state == "initialization" else it.begin() if state == "step" else None
            real = v.type == REAL[fmu.version]
            if real:
                value = 0.7 * float(v.start) or 0.1
                if v.min is not None and value < float(v.min):
                    value = 1.3 * float(v.start)
            else:
                value = {"true": 1, "false": 0}.get(v.start) if v.type == "Boolean" else int(v.start)
            assert it.set(v.name, value) == OK, (v.name, it.messages)
            if fmu.version == 2 and state == "instantiated":
                it.enter()
            assert it.get(v.name) == [value], v.name
            it.free()


@case
def set_does_not_recompute(fmu):
    """Between steps the outputs are those of the last step, even if the inputs have changed."""
    it = fmu.instance().begin()
    run(it, 10)
    before = it.reals("Get", fmu.of("output"))
    for v in fmu.of("input"):
        assert it.set(v.name, -33.0 if v.name == "tau_limit_min" else 33.0) == OK
        assert it.reals("Get", fmu.of("output")) == before


@case
def odd_booleans(fmu):
    """Any number but 0 is true, and comes back as 1."""
    for v in fmu.settable():
        if v.type == "Boolean":
            for value in (2, 255, *([-1, 2**31 - 1] if fmu.version == 2 else [])):
                it = fmu.instance().enter()
                assert it.set(v.name, value) == OK
                assert it.get(v.name) == [1]
                it.free()


@case
def extreme_numbers(fmu):
    """Denormal, -0.0 and enormous inputs: OK or an error, never a hang or NaN; a reset recovers the instance."""
    trace = alone(fmu, 10)
    it = fmu.instance()
    for variable in fmu.of("input", "parameter"):
        for value in (5e-324, -0.0, 1e-200, 1e150, 1e308, -1e308):
            if it.set(variable.name, value) == OK and it.set_up() == OK:
                started = it.version == 3 or it.call("EnterInitializationMode") == OK
                if started and it.call("ExitInitializationMode") == OK:
                    for _ in range(3):
                        it.step()
                    for v in fmu.of("output"):
                        assert not math.isnan(it.get(v.name)[0]), (variable.name, value, v.name)
            recovers(it, trace)
            assert it.call("Reset") == OK
