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
    pair = fmurun.Plan({"p": drives.PmsmPlant, "c": drives.SensorlessController}, stop_time=0.01, step_size=1e-4, start_values={
        f"{x}.{name}": value for x, fmu in (("p", "PmsmPlant"), ("c", "SensorlessController"))
        for name, value in drives.tune("ipmsm-2.2kw", fmu=fmu).items()})  # fmt: skip
    assert np.isfinite(pair.simulate()["p.speed"]).all()


def test_wrong_names_are_one_line(tmp_path):
    (tmp_path / "bad.toml").write_text("name = 3")
    for call, kind, part in (
        (lambda: drives.PmsmDrives, AttributeError, "the wheel has no drive PmsmDrives for FMI 3.0; it has Pmsm"),
        (lambda: drives.fmi2.Motor, AttributeError, "no drive Motor for FMI 2.0"),
        (lambda: drives.tune("nothing"), FmuError, "nothing: is neither a motor file nor one of"),
        (lambda: drives.tune(tmp_path / "bad.toml"), FmuError, "bad.toml:1"),
        (lambda: drives.tune("ipmsm-2.2kw", estimator="Guess"), FmuError, "Guess"),
        (lambda: drives.tune("ipmsm-2.2kw", fmu="Motor"), ValueError, "fmu must be one of"),
        (lambda: drives.tune("ipmsm-2.2kw", fmi=1), ValueError, "fmi must be 2 or 3"),
    ):
        with pytest.raises(kind, match=part) as caught:
            call()
        assert "\n" not in str(caught.value)


def test_doctests(run_doctests):
    assert run_doctests("fmurun.drives") > 1
