"""The low-level classes: `examples/load_step.py` with another import, threads, states, errors."""

import gc
import os
import pickle
import re
import runpy
import sys
import threading
from pathlib import Path

import fmurun
import pytest
from fmurun import FmuError, _core
from fmurun.fmpy import extract, instantiate_fmu, read_model_description

EXAMPLES = Path(__file__).parents[2] / "examples"


def initialized(archive):
    description = read_model_description(archive)
    instance = instantiate_fmu(archive, description)
    if description.fmiVersion == "2.0":
        instance.setupExperiment()
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    return instance, {v.name: v.valueReference for v in description.modelVariables}


def test_load_step_by_its_import(standard, tmp_path, monkeypatch, capsys):
    """The unchanged script, with FMPy and with fmurun: the same output. matplotlib is not installed."""
    import types

    class Nothing:
        def __getattr__(self, name):
            return lambda *a, **k: (Nothing(), [Nothing(), Nothing(), Nothing()]) if name == "subplots" else Nothing()

        def __getitem__(self, key):
            return self

    plot = types.ModuleType("matplotlib.pyplot")
    plot.subplots = Nothing().subplots
    monkeypatch.setitem(sys.modules, "matplotlib", types.ModuleType("matplotlib"))
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", plot)
    sys.modules["matplotlib"].pyplot = plot
    text = (EXAMPLES / "load_step.py").read_text().replace("STOP = 1e-4, 3.0", "STOP = 1e-4, 0.6")
    changed = text.replace("from fmpy import", "from fmurun.fmpy import")
    assert changed != text
    assert "0.6" in changed
    monkeypatch.setattr(sys, "argv", ["load_step.py", str(standard)])
    monkeypatch.chdir(tmp_path)
    said = []
    for script in (text, changed):
        (tmp_path / "script.py").write_text(script)
        runpy.run_path(str(tmp_path / "script.py"))
        said.append(capsys.readouterr().out)
    assert said[0] == said[1]
    assert re.match(r"dip -?\d", said[0])


def test_the_description_is_fmpys(standard):
    import fmpy

    for archive in sorted(standard.glob("*.fmu")):
        ours, theirs = read_model_description(archive), fmpy.read_model_description(archive)
        for name in ("fmiVersion", "modelName", "guid", "description", "variableNamingConvention", "generationTool"):
            assert getattr(ours, name) == getattr(theirs, name), name
        for name in ("modelIdentifier", "canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "hasEventMode",
                     "canSerializeFMUstate", "canBeInstantiatedOnlyOncePerProcess", "fixedInternalStepSize"):  # fmt: skip
            assert getattr(ours.coSimulation, name) == getattr(theirs.coSimulation, name), name
        for name in ("startTime", "stopTime", "stepSize"):
            mine, other = getattr(ours.defaultExperiment, name), getattr(theirs.defaultExperiment, name)
            assert (mine is None) == (other is None)
            assert mine is None or float(mine) == float(other)
        assert len(ours.modelVariables) == len(theirs.modelVariables) > 20
        for mine, other in zip(ours.modelVariables, theirs.modelVariables):
            for name in ("name", "valueReference", "type", "causality", "variability", "initial", "start", "shape", "description"):
                assert getattr(mine, name) == getattr(other, name), (mine.name, name)
        assert [u.variable.name for u in ours.outputs] == [u.variable.name for u in theirs.outputs]


def test_types_and_states(standard):
    instance, reference = initialized(standard / "SensorlessController.fmu")
    number = "getInteger" if standard.name == "fmi2" else "getInt32"
    assert getattr(instance, number)([reference["motor.n_p"]]) == [3]
    assert instance.getBoolean([reference["enabled"]]) in ([True], [False])
    state = instance.getFMUState()
    stored = instance.serializeFMUState(state)
    for k in range(10):
        instance.doStep(k * 1e-4, 1e-4)
    other, _ = initialized(standard / "SensorlessController.fmu")
    with pytest.raises(FmuError, match="the state belongs to another instance"):
        other.setFMUState(state)
    instance.setFMUState(instance.deserializeFMUState(stored))
    instance.doStep(0.0, 1e-4)
    instance.freeFMUState(state)
    with pytest.raises(FmuError, match="the state was freed"):
        instance.setFMUState(state)
    instance.reset()
    instance.freeInstance()
    with pytest.raises(FmuError, match="was freed"):
        instance.terminate()


def test_an_instance_in_another_thread(standard):
    """Created in one thread, used in another, and again in the first: Dask's workers and vector environments do
    this."""
    instance, reference = initialized(standard / "PmsmPlant.fmu")
    read = instance.getReal if standard.name == "fmi2" else instance.getFloat64
    found = []

    def use():
        for k in range(200):
            instance.doStep(k * 1e-4, 1e-4)
        found.append(read([reference["speed"]]))

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert found == [read([reference["speed"]])]


def test_a_failed_instance_leaves_nothing(plant, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    for _ in range(5):
        with pytest.raises(FmuError):
            fmurun.simulate_fmu(plant, start_values={"motor.R_s": -1.0})
    gc.collect()
    assert os.listdir(tmp_path) == []


def test_extract_stays_inside(tmp_path):
    import zipfile

    with zipfile.ZipFile(tmp_path / "evil.fmu", "w") as file:
        file.writestr("../evil", "x")
    with pytest.raises(FmuError, match="leads outside"):
        extract(tmp_path / "evil.fmu")


def test_an_error_can_be_pickled(plant):
    with pytest.raises(FmuError) as caught:
        fmurun.simulate_fmu(plant, start_values={"motor.R_s": -1.0})
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert (again.function, again.status, again.message) == ("fmi3SetFloat64", "Error", caught.value.message)


def test_a_panic_is_an_exception():
    with pytest.raises(FmuError, match="a fault of fmurun: asked for"):
        _core._panic()


def test_wrong_arguments_are_exceptions(plant):
    instance, reference = initialized(plant)
    speed = [reference["speed"]]
    for call in (
        lambda: instance.getFloat64(["speed"]),
        lambda: instance.getFloat64([-1]),
        lambda: instance.getFloat64([2**40]),
        lambda: instance.getFloat64(None),
        lambda: instance.setFloat64(speed, ["x"]),
        lambda: instance.setFloat64(speed, [1.0, 2.0]),
        lambda: instance.doStep(None, 1.0),
        lambda: instance.doStep(0.0, float("nan")),
        lambda: instance.getInt32([2**32 - 1]),
        lambda: instance.setFMUState(None),
        lambda: instance.deserializeFMUState(b"nothing"),
    ):
        with pytest.raises((FmuError, TypeError, ValueError, OverflowError)):
            call()


def test_doctests(run_doctests):
    modules = ["fmurun._error", "fmurun._simulate", "fmurun._batch"]
    assert sum(run_doctests(module) for module in modules) > 10
