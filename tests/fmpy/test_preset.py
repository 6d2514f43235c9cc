"""PmsmDrive with the start values of `fmu preset` in FMPy: results, reset, saved states, and refusals with their cause.

`FMU_PRESETS` names the folder with fmi2/Pump.fmu and fmi3/Pump.fmu; `FMU_ARCHIVES` that of the FMUs without preset.
"""

import json
import os
import shutil
from ctypes import byref, c_bool, c_char_p, c_int, c_size_t, c_void_p, cast
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu

FILE = "fmu-preset.json"
VALUES = {
    "plant.motor.R_s": 3.25,
    "plant.initial.speed": np.pi,
    "controller.estimator": 15,
    "controller.current.mtpa": True,
    "controller.motor.n_p": 4,
    "plant.motor.n_p": 4,
}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request):
    return request.param


@pytest.fixture
def pump(version):
    return Path(os.environ["FMU_PRESETS"]) / f"fmi{version}" / "Pump.fmu"


@pytest.fixture
def folder(pump, tmp_path):
    shutil.unpack_archive(pump, tmp_path / "unpacked", "zip")
    return tmp_path / "unpacked"


class Raw:
    """An instance through the C functions, with a given resource path and token."""

    def __init__(self, folder, version, exchange=False):
        self.version, self.said = version, []
        self.description = fmpy.read_model_description(str(folder))
        kind = {2: (FMU2Slave, FMU2Model), 3: (FMU3Slave, FMU3Model)}[version][exchange]
        self.exchange = exchange
        self.fmu = kind(
            guid=self.description.guid, unzipDirectory=str(folder), modelIdentifier="PmsmDrive", instanceName="it"
        )
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}

    def instantiate(self, resources, token=None):
        """Whether there is an instance; `said` holds the FMU's log messages."""
        token = (token or self.description.guid).encode()
        path = resources.encode() if resources is not None else None
        if self.version == 2:
            from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

            def log(_environment, _name, _status, _category, message):
                self.said.append(message.decode())

            self.keep = fmi2CallbackFunctions()
            self.logger = fmi2CallbackLoggerTYPE(log)
            self.keep.logger = self.logger
            function = self.fmu.dll.fmi2Instantiate
            function.restype = c_void_p
            function.argtypes = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
            it = function(b"it", 0 if self.exchange else 1, token, path, byref(self.keep), 0, 0)
        else:
            from fmpy.fmi3 import fmi3LogMessageCallback

            def log(_environment, _status, _category, message):
                self.said.append(message.decode())

            self.logger = fmi3LogMessageCallback(log)
            logger = cast(self.logger, c_void_p)
            texts = [c_char_p, c_char_p, c_char_p, c_bool, c_bool]
            if self.exchange:
                function = self.fmu.dll.fmi3InstantiateModelExchange
                types, more = [c_void_p, c_void_p], [None, logger]
            else:
                function = self.fmu.dll.fmi3InstantiateCoSimulation
                types = [c_bool, c_bool, c_void_p, c_size_t, c_void_p, c_void_p, c_void_p]
                more = [False, False, None, 0, None, logger, None]
            function.restype, function.argtypes = c_void_p, texts + types
            it = function(b"it", token, path, False, False, *more)
        self.fmu.component = it
        return it is not None

    def enter(self):
        if self.version == 2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()

    def real(self, name):
        get = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        return get([self.reference[name]])[0]

    def set(self, name, value):
        put = self.fmu.setReal if self.version == 2 else self.fmu.setFloat64
        put([self.reference[name]], [value])

    def state(self):
        return self.fmu.getFMUstate() if self.version == 2 else self.fmu.getFMUState()

    def restore(self, state):
        return self.fmu.setFMUstate(state) if self.version == 2 else self.fmu.setFMUState(state)

    def bytes(self, state):
        return self.fmu.serializeFMUstate(state) if self.version == 2 else self.fmu.serializeFMUState(state)

    def from_bytes(self, data):
        return self.fmu.deSerializeFMUstate(data) if self.version == 2 else self.fmu.deserializeFMUState(data)

    def resources(self, folder):
        path = folder / "resources"
        return path.as_uri() if self.version == 2 else f"{path}{os.sep}"


def test_fmpy_finds_no_problem(pump):
    assert validate_fmu(str(pump)) == []
    description = fmpy.read_model_description(str(pump))
    assert (description.modelName, description.coSimulation.modelIdentifier) == ("Pump", "PmsmDrive")
    start = {v.name: v.start for v in description.modelVariables}
    assert float(start["plant.motor.R_s"]) == 3.25 and start["controller.estimator"] == "15"


def test_it_runs_as_the_drive_with_these_values(pump, version, archives):
    drive = archives / f"fmi{version}" / "PmsmDrive.fmu"
    output = ["speed", "speed_est", "i_d", "i_q", "tau_e", "p_in"]
    inputs = np.array([(0.0, 0.0), (0.05, 0.0), (0.05, 60.0)], dtype=[("time", float), ("speed_ref", float)])
    options = dict(stop_time=0.3, step_size=1e-3, output_interval=1e-3, input=inputs, output=output)
    preset = fmpy.simulate_fmu(str(pump), **options)
    set_by_fmpy = fmpy.simulate_fmu(str(drive), start_values=VALUES, **options)
    plain = fmpy.simulate_fmu(str(drive), **options)
    for name in output:
        assert np.array_equal(preset[name], set_by_fmpy[name]), name
    assert not np.array_equal(preset["speed"], plain["speed"])
    assert preset["speed"][-1] == pytest.approx(60, rel=0.1)


@pytest.mark.parametrize("exchange", [False, True], ids=["cs", "me"])
def test_reset_and_saved_states(folder, version, exchange):
    raw = Raw(folder, version, exchange)
    assert raw.instantiate(raw.resources(folder)), raw.said
    raw.enter()
    assert (raw.real("plant.motor.R_s"), raw.real("plant.initial.speed")) == (3.25, np.pi)
    assert raw.real("speed") == np.pi
    state = raw.state()
    data = raw.bytes(state)
    raw.set("plant.motor.R_s", 1.0)
    raw.restore(state)
    assert raw.real("plant.motor.R_s") == 3.25
    raw.set("plant.motor.R_s", 1.0)
    raw.fmu.reset()
    raw.enter()
    assert (raw.real("plant.motor.R_s"), raw.real("speed")) == (3.25, np.pi)
    raw.set("plant.motor.R_s", 1.0)
    raw.restore(raw.from_bytes(data))
    assert raw.real("plant.motor.R_s") == 3.25
    raw.fmu.freeInstance()


@pytest.mark.parametrize("exchange", [False, True], ids=["cs", "me"])
def test_without_its_preset_there_is_no_instance(folder, version, exchange, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    start = {"plant.motor.R_s": "9.0"}
    (wrong / FILE).write_text(json.dumps({"format": "fmu preset", "version": 2, "start": start}))
    for resources, why in [
        (None, "the importer names no folder of resources"),
        ("", "the importer names no folder of resources"),
        ("http://example.org/resources", "the importer names no folder of resources"),
        (str(tmp_path / "nowhere"), f"{FILE}: No such file or directory"),
        (empty.as_uri(), f"{FILE}: No such file or directory"),
        (str(wrong), "its hash is {"),
    ]:
        raw = Raw(folder, version, exchange)
        assert not raw.instantiate(resources), resources
        assert any(why in message for message in raw.said), raw.said
    raw = Raw(folder, version, exchange)
    assert raw.instantiate(raw.resources(folder))
    raw.fmu.freeInstance()


def test_a_plain_token_has_no_preset(folder, version):
    for resources in (None, "", str(folder / "resources")):
        raw = Raw(folder, version)
        plain = raw.description.guid.split("+")[0]
        assert raw.instantiate(resources, plain), raw.said
        raw.enter()
        assert raw.real("plant.motor.R_s") == 2.0
        raw.fmu.freeInstance()


def test_another_hash_is_refused(folder, version):
    raw = Raw(folder, version)
    token = raw.description.guid
    other = token[:-2] + ("0" if token[-2] != "0" else "1") + token[-1]
    assert not raw.instantiate(raw.resources(folder), other)
    assert any("its hash is {" in message for message in raw.said), raw.said
    changed = folder / "resources" / FILE
    changed.write_text(changed.read_text().replace("3.25", "3.26"))
    raw = Raw(folder, version)
    assert not raw.instantiate(raw.resources(folder))
    assert any("the file was changed, or is of another archive" in message for message in raw.said), raw.said
