"""The packed drive commissions itself, at standstill and rotating: the bits of the native run in both standards, saved
and restored in each state of the sequence; aborts; parameters that do not fit. `FMU_COMMISSIONING` names the values of
the native run, as hexadecimal numbers."""

import json
import os
from pathlib import Path

import pytest

from pair import Unit

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
H = 5e-3
REAL = {"controller.commission.i": 7.5, "controller.commission.speed": 314.0, "plant.inverter.dead_time": 2e-6, "plant.initial.theta_e": 0.7}
OFFSETS, RESISTANCE, START, LEVELS, DONE, REFUSED = 2, 5, 9, 10, 11, 12
MODES = {"Standstill": 2, "Spin": 3}
VOLTAGE, NOT_FOLLOWING, ABORTED = 3, 6, 11


class Drive(Unit):
    """A PmsmDrive that starts a commissioning at once."""

    def __init__(self, archives, standard, mode="Standstill", **parameters):
        names = {"controller.commission.mode": MODES[mode]}
        super().__init__(archives / f"fmi{standard}" / "PmsmDrive.fmu", REAL | parameters, names, {"commission_start": True})
        self.k = 0

    def step(self, n=1):
        for _ in range(n):
            self.slave.doStep(currentCommunicationPoint=self.k * H, communicationStepSize=H)
            self.k += 1

    def status(self):
        get = self.slave.getInteger if self.fmi2 else self.slave.getInt64
        return tuple(get(self.of("commission_state", "commission_fault")))

    def set(self, name, value):
        self.slave.setBoolean(self.of(name), [value])

    def enabled(self):
        return bool(self.slave.getBoolean(self.of("enabled"))[0])

    def until(self, state):
        while self.status()[0] != state:
            assert self.k < 10_000, self.status()
            self.step()

    def store(self):
        return self.slave.serializeFMUstate(self.slave.getFMUstate()) if self.fmi2 else self.slave.serializeFMUState(self.slave.getFMUState())

    def restore(self, stored):
        if self.fmi2:
            self.slave.setFMUstate(self.slave.deSerializeFMUstate(stored))
        else:
            self.slave.setFMUState(self.slave.deserializeFMUState(stored))


@STANDARDS
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("restored", [False, True], ids=["straight", "restored"])
def test_a_commissioning_has_the_bits_of_the_native_one(archives, standard, mode, restored):
    native = json.loads(Path(os.environ["FMU_COMMISSIONING"]).read_text())[mode]
    drive, seen = Drive(archives, standard, mode), {}
    while drive.status()[0] not in (DONE, REFUSED):
        drive.step()
        state = drive.status()[0]
        seen[state] = seen.get(state, 0) + 1
        if restored and seen[state] == 3:
            stored, k = drive.store(), drive.k
            drive.set("commission_start", False)
            drive.step(5)
            assert drive.status() == (REFUSED, ABORTED)
            drive.restore(stored)
            drive.k = k
    assert drive.status() == (DONE, 1) and not drive.enabled()
    spin = mode == "Spin"
    assert set(range(OFFSETS, DONE if spin else START)) <= seen.keys()
    assert drive.k == native.pop("steps")
    found = drive.get_reals(drive.of(*native))
    assert {name: x.hex() for name, x in zip(native, found)} == {name: float.fromhex(x).hex() for name, x in native.items()}
    by_name = dict(zip(native, found))
    assert by_name["identified_R_s"] == pytest.approx(2.0, rel=1e-3) and by_name["identified_L_q"] == pytest.approx(6e-3, rel=0.01)
    turning = {name: drive.get_reals(drive.of(f"plant.{name}"))[0] for name in ("motor.psi_M", "mechanics.J")}
    for name, truth in turning.items():
        name = f"identified_{name.split('.')[1]}"
        assert by_name[name] == (pytest.approx(truth, rel=0.01) if spin else 0.0), name
        assert by_name[f"{name}_u"] < 0.05 if spin else by_name[f"{name}_u"] == 1.0, name
    drive.close()


@STANDARDS
@pytest.mark.parametrize("name, value", [("commission_start", False), ("enable", False), ("asc", True)])
@pytest.mark.parametrize("state", [RESISTANCE, LEVELS], ids=["standing", "turning"])
def test_an_abort_opens_the_gates(archives, standard, name, value, state):
    drive = Drive(archives, standard, "Spin")
    drive.until(state)
    assert drive.enabled()
    drive.set(name, value)
    drive.slave.doStep(currentCommunicationPoint=drive.k * H, communicationStepSize=1e-4)
    assert drive.status() == (REFUSED, ABORTED) and not drive.enabled()
    drive.close()


@STANDARDS
def test_a_turning_rotor_and_a_falling_link_are_refused(archives, standard):
    drive = Drive(archives, standard, **{"plant.initial.speed": 100.0})
    drive.until(REFUSED)
    assert drive.status() == (REFUSED, NOT_FOLLOWING) and not drive.enabled()
    drive.close()
    drive = Drive(archives, standard)
    drive.until(RESISTANCE)
    drive.set_reals(drive.of("u_dc"), [255.0])
    drive.step()
    assert drive.status() == (REFUSED, VOLTAGE) and not drive.enabled()
    drive.close()


@STANDARDS
@pytest.mark.parametrize("name, value", [("controller.commission.i", 7.6), ("controller.commission.i", 0.0), ("controller.commission.speed", 0.0)])
def test_parameters_that_do_not_fit_are_refused(archives, standard, name, value):
    with pytest.raises(Exception, match="fmi[23](ExitInitializationMode|SetReal|SetFloat64)"):
        Drive(archives, standard, **{name: value})
