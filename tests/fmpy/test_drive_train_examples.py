"""The examples of docs/drive-train.md for FMPy: PmsmDriveMean instead of PmsmDrive changes the energy by less than 0.5 %."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ["pump", "axis"]


def run(script, *words):
    """The output of the script."""
    command = [sys.executable, ROOT / "examples/drive-train" / f"{script}.py", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env={**os.environ, "MPLBACKEND": "Agg"})
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers(text):
    return [float(x) for x in re.findall(r"[+-]?\d+\.\d+", text)]


def close(text):
    """Each drive differs from the first by less than 0.5 %."""
    differences = [float(x) for x in re.findall(r"differs from \w+ by ([+-][\d.]+) %", text)]
    assert differences and max(map(abs, differences)) < 0.5, text
    return len(differences)


def test_another_file_name_is_another_drive(archives):
    text = run("axis", *(archives / "fmi2" / f"{name}.fmu" for name in ("PmsmDrive", "PmsmDriveMean")), "--stop", 1.4)
    assert close(text) == 1
    assert numbers(text.splitlines()[1])[0] == pytest.approx(0.325, rel=0.01), text


@pytest.mark.parametrize("script", EXAMPLES)
def test_the_page_has_what_the_script_prints(archives, script, tmp_path):
    """The whole example with FMI 3.0: the numbers of the page, and the labels of its plot."""
    drives = [archives / "fmi3" / f"{name}.fmu" for name in ("PmsmDrive", "PmsmDriveMean")]
    text = run(script, *drives, "--plot", tmp_path / "plot.svg")
    assert close(text) == len(drives) - 1
    page = (ROOT / "docs/drive-train.md").read_text()
    shown = page[page.index("energy in kJ", page.index(f"{script}.py")) :].split("```")[0]
    # Some of the last digits are rounding errors.
    assert re.findall(r"[A-Za-z]+", shown) == re.findall(r"[A-Za-z]+", text), text
    assert numbers(shown) == pytest.approx(numbers(text), rel=2e-3, abs=2e-3), text
    labels = [re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text())
              for path in (tmp_path / "plot.svg", ROOT / f"docs/drive-train-{script}.svg")]  # fmt: skip
    assert labels[0] == labels[1] and "time [s]" in labels[0]


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
@pytest.mark.parametrize(("script", "drives"), [("brownout", ["PmsmDrive", "PmsmDriveMean"]), ("scooter", ["PmsmDrive"])])
def test_modes(archives, standard, script, drives):
    """The numbers of docs/modes.md, in both standards."""
    text = run(script, *(archives / standard / f"{drive}.fmu" for drive in drives))
    page = (ROOT / "docs/modes.md").read_text()
    shown = page[page.index("energy in kJ", page.index(f"{script}.py")) :].split("```")[0]
    assert numbers(shown) == pytest.approx(numbers(text), rel=2e-3, abs=2e-3), text
