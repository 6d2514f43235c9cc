"""The drives in the wheel, and `tune`: start values that FMPy and fmurun take."""

import json
import os
import subprocess

import fmpy
import fmurun
import numpy as np
import pytest
from fmurun import FmuError, drives, simulate_fmu


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("motor", ["ipmsm-2.2kw", "pmsyrm-5.5kw"])
def test_fmpy_takes_the_values(fmi, motor):
    """The second machine has a flux map: arrays."""
    archive = drives.PmsmDrive if fmi == 3 else drives.fmi2.PmsmDrive
    arguments = {"start_values": drives.tune(motor, fmi=fmi) | {"speed_ref": 50.0}, "stop_time": 0.1, "output_interval": 1e-3}
    ours, theirs = simulate_fmu(archive, **arguments), fmpy.simulate_fmu(archive, **arguments)
    assert ours.tobytes() == theirs.tobytes()
    assert np.ptp(ours["speed"]) > 1.0


def test_the_wheel_has_what_the_build_made(archives):
    for module, folder in ((drives, "fmi3"), (drives.fmi2, "fmi2")):
        for archive in (archives / folder).glob("*.fmu"):
            if hasattr(module, archive.stem):
                assert os.path.getsize(getattr(module, archive.stem)) == archive.stat().st_size
        assert {"PmsmDrive", "PmsmPlant", "SensorlessController"} <= set(dir(module))
    assert len(drives.machines) >= 15


def test_the_command_gives_the_same():
    def tuned(*arguments, motor="ipmsm-2.2kw"):
        command = [os.environ["FMU_COMMAND"], "tune", drives.machines[motor], "--json", *arguments]
        return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    values = tuned()
    for fmu in ("PmsmDrive", "PmsmPlant", "SensorlessController"):
        assert values[fmu] == drives.tune("ipmsm-2.2kw", fmu=fmu)
    other = drives.tune("servo-6.6kw", estimator="ExtendedEmf")
    assert tuned("--estimator", "ExtendedEmf", motor="servo-6.6kw")["PmsmDrive"] == other != drives.tune("servo-6.6kw")
    assert other["controller.estimator"] == 4
    words = ("--estimator", "Sensored", "--control", "torque", "--shaft", "imposed")
    vehicle = drives.tune("traction-100kw", estimator="Sensored", control="torque", shaft="imposed")
    assert tuned(*words, motor="traction-100kw")["PmsmDrive"] == vehicle
    assert vehicle["plant.mechanics.imposed"] and vehicle["controller.speed_loop.torque_mode"]
    pair = fmurun.Plan({"p": drives.PmsmPlant, "c": drives.SensorlessController}, stop_time=0.01, step_size=1e-4, start_values={
        f"{x}.{name}": value for x, fmu in (("p", "PmsmPlant"), ("c", "SensorlessController"))
        for name, value in drives.tune("ipmsm-2.2kw", fmu=fmu).items()})  # fmt: skip
    assert np.isfinite(pair.simulate()["p.speed"]).all()


def test_wrong_names_are_one_line(tmp_path):
    (tmp_path / "bad.toml").write_text("name = 3")
    for call, kind, part in (
        (lambda: drives.PmsmDrives, AttributeError, "the wheel has no drive PmsmDrives for FMI 3.0; it has MappedDrive, .* did you mean PmsmDrive"),
        (lambda: drives.fmi2.Motor, AttributeError, "no drive Motor for FMI 2.0"),
        (lambda: drives.tune("nothing"), FmuError, "nothing: is neither a motor file nor one of"),
        (lambda: drives.tune("traction-100"), FmuError, "did you mean traction-100kw"),
        (lambda: drives.tune(tmp_path / "bad.toml"), FmuError, "bad.toml:1"),
        (lambda: drives.tune("ipmsm-2.2kw", estimator="Guess"), FmuError, "Guess"),
        (lambda: drives.tune("ipmsm-2.2kw", control="current"), FmuError, "control = current: must be speed or torque"),
        (lambda: drives.tune("ipmsm-2.2kw", shaft="imposed"), FmuError, "I-f start of ExtendedEmf"),
        (lambda: drives.tune("ipmsm-2.2kw", fmu="Motor"), ValueError, "fmu must be one of"),
        (lambda: drives.tune("ipmsm-2.2kw", fmi=1), ValueError, "fmi must be 2 or 3"),
    ):
        with pytest.raises(kind, match=part) as caught:
            call()
        assert "\n" not in str(caught.value)


def test_doctests(run_doctests):
    assert run_doctests("fmurun.drives") > 1


def test_from_datasheet(tmp_path):
    """The values are those of the command, and the drive runs with them in both standards."""
    sheet = tmp_path / "drive.toml"
    example = subprocess.run([os.environ["FMU_COMMAND"], "datasheet", "--example"], check=True, capture_output=True, text=True).stdout
    sheet.write_text(example)
    command = [os.environ["FMU_COMMAND"], "datasheet", sheet, "--json"]
    values = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert values == drives.from_datasheet(sheet)
    runs = [
        simulate_fmu(module.MappedDrive, start_values=drives.from_datasheet(sheet, fmi=fmi) | {"speed_ref": 200.0}, stop_time=2.0)
        for module, fmi in ((drives, 3), (drives.fmi2, 2))
    ]
    assert runs[0]["speed"][-1] == runs[1]["speed"][-1] == pytest.approx(200.0, abs=0.5)
    sheet.write_text(example.replace("0.86, 0.84", "86, 0.84"))
    with pytest.raises(FmuError, match="drive.toml: losses.efficiency.* is greater than 1"):
        drives.from_datasheet(sheet)
    sheet.write_text(example.replace("610, 1130]", "610, 370]"))
    with pytest.warns(UserWarning, match="losses.no_load is 370 W at 8000 rpm"):
        drives.from_datasheet(sheet)
    with pytest.raises(ValueError, match="fmi must be 2 or 3, not 1"):
        drives.from_datasheet(sheet, fmi=1)
