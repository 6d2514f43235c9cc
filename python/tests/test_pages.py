"""Every Python line of every page runs: one page after the other in this process, its blocks in one name space, with short runs."""

import ast
import re
import shutil
import sys
import textwrap
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from distributed import Client, LocalCluster
from fmpy import extract

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^ *```python\n(.*?)^ *```", re.S | re.M)
# Runs and sweeps take a fraction of what they take on the page.
SHORTER = [
    (r"\bstop_time=[\d.]+", "stop_time=0.02"),
    (r"\bplan\.rows\(0, 1000\)", "plan.rows(0, 4)"),
    (r'"tau_load", "tau_e", inputs=', '"tau_load", "tau_e", frequencies=[50.0, 100.0], inputs='),
    (r'"examples/vehicle/cycle\.csv"', '"cycle.csv"'),
]
# Statements that need what is not there: page -> its beginning and the reason.
LEFT_OUT = {
    "python/docs/migrating.md": [
        ("model = load_fmu(", "PyFMI needs Assimulo and SUNDIALS, built by a Fortran compiler"),
        ("model.set(", "PyFMI"),
        ("opts = ", "PyFMI"),
        ("opts[", "PyFMI"),
        ("res = model.", "PyFMI"),
        ('speed = res["speed"]', "PyFMI"),
        ("Master(", "PyFMI"),
        ("model = SSP()", "OMSimulator is not in the environment of the tests"),
        ("model.add", "OMSimulator"),
        ("run = model.", "OMSimulator"),
        ("run.", "OMSimulator"),
    ]
}


def blocks():
    """Page -> its blocks, each with the line of the page above it."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("python/*.md"), *ROOT.glob("python/docs/**/*.md"),
             *ROOT.glob("examples/**/*.md"), *ROOT.glob("*/README.md")]  # fmt: skip
    found = {}
    for page in sorted(set(pages)):
        text = page.read_text()
        inside = [(text.count("\n", 0, block.start(1)), textwrap.dedent(block[1])) for block in BLOCK.finditer(text)]
        if inside:
            found[str(page.relative_to(ROOT))] = inside
    return found


BLOCKS = blocks()


@pytest.fixture(scope="module")
def workshop(archives, tmp_path_factory):
    """A folder with the files that the pages name."""
    folder = tmp_path_factory.mktemp("pages")
    fmi3 = archives / "fmi3"
    for of, names in {
        "PmsmDrive": ["PmsmDrive", "Drive", "target/fmu/fmi3/PmsmDrive"],
        "PmsmPlant": ["PmsmPlant", "Plant"],
        "SensorlessController": ["SensorlessController", "Controller"],
    }.items():
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(fmi3 / f"{of}.fmu", folder / f"{name}.fmu")
    shutil.copytree(ROOT / "motors", folder / "motors")
    cycle = (ROOT / "examples/vehicle/cycle.csv").read_text().splitlines()
    (folder / "cycle.csv").write_text("\n".join(cycle[:8]) + "\n")
    shutil.copy(ROOT / "src/commands/datasheet.toml", folder / "drive.toml")
    sweep = (ROOT / "examples/sweep.toml").read_text()
    sweep = sweep.replace("../target", "target").replace("stop = 0.2", "stop = 0.16").replace("runs = 100000", "runs = 4")
    (folder / "sweep.toml").write_text(sweep)
    return folder


def of_page(page, folder):
    """The names that the text around the blocks of a page introduces, and that a page takes from the one before it."""
    import fmurun
    from fmurun import Plan, drives, simulate_fmu

    names = {"fmurun": fmurun, "np": np, "pandas": pd, "drives": drives, "simulate_fmu": simulate_fmu, "Plan": Plan}
    if page in ("python/docs/derivatives.md", "python/docs/clusters.md"):
        measures = {"dip": ("p.speed", "min"), "end_speed": "p.speed"}
        names["plan"] = Plan({"p": "PmsmPlant.fmu", "c": "SensorlessController.fmu"}, stop_time=0.02, step_size=1e-4, measures=measures)
    if page == "python/docs/clusters.md":
        import dask.dataframe

        names["frame"] = dask.dataframe.from_pandas(pd.DataFrame({"p.motor.R_s": [1.9, 2.1]}), npartitions=1)
    if page == "python/docs/learning.md":
        names["voltages"] = np.zeros((256, 3))
    if page == "docs/import.md":
        import casadi

        names |= {"casadi": casadi, "FOLDER": str(extract("PmsmPlant.fmu"))}
    if page == "docs/modelica.md":
        twice = "".join(f"  function {name}\n    input Integer x;\n  end {name};\n" for name in ("AToInteger", "BToInteger", "AToInteger"))
        (folder / "Block.mo").write_text(twice)
    if page == "docs/drive-train.md":
        shape, maps = (1, 1, 3, 5), ("torque", "p_in", "p_mech")
        (folder / "target/map").mkdir(parents=True, exist_ok=True)
        np.savez(folder / "target/map/map.npz", **{name: np.ones(shape) for name in maps})
    if page == "docs/sweeps.md":
        runs = Plan.from_toml("sweep.toml").run_many(Plan.from_toml("sweep.toml").rows(0, 4))
        (folder / "target/sweep").mkdir(parents=True, exist_ok=True)
        pd.DataFrame(runs).to_csv(folder / "target/sweep/results.csv", index=False)
    return names


def statements(page, line, code):
    """The statements of a block as (place, beginning, code), without those that are left out."""
    for of, by in SHORTER:
        code = re.sub(of, by, code)
    for node in ast.parse(code).body:
        text = ast.get_source_segment(code, node)
        if not any(text.startswith(beginning) for beginning, _ in LEFT_OUT.get(page, [])):
            yield f"{page}:{line + node.lineno}", text


@pytest.mark.parametrize("page", list(BLOCKS))
def test_every_line_runs(page, workshop, monkeypatch):
    monkeypatch.chdir(workshop)
    matplotlib.use("Agg")
    names = of_page(page, workshop)
    monkeypatch.setattr(sys, "argv", ["repair.py", str(workshop / "Block.mo")])
    client = None
    if any("client" in code for _, code in BLOCKS[page]):
        cluster = LocalCluster(1, processes=False, threads_per_worker=1, dashboard_address=None, silence_logs=50)
        client = names["client"] = Client(cluster)
    ran = 0
    try:
        for line, code in BLOCKS[page]:
            for place, text in statements(page, line, code):
                try:
                    exec(compile(text, place, "exec"), names)
                except Exception as error:
                    pytest.fail(f"{place}: {text}\n{type(error).__name__}: {error}", pytrace=False)
                ran += 1
    finally:
        if client:
            client.close()
            cluster.close()
    assert ran > 0
    if page == "docs/modelica.md":
        assert (workshop / "Block.mo").read_text().count("function AToInteger") == 1


def test_what_is_left_out_is_there():
    for page, beginnings in LEFT_OUT.items():
        nodes = [ast.get_source_segment(code, node) for _, code in BLOCKS[page] for node in ast.parse(code).body]
        for beginning, reason in beginnings:
            assert reason and any(text.startswith(beginning) for text in nodes), f"{page}: {beginning}"


def test_a_wrong_line_is_found():
    assert len(BLOCKS) > 10 and sum(map(len, BLOCKS.values())) > 25
    [(place, text)] = statements("docs/import.md", 7, "simulate_fmu('x.fmu', stop_time=3.0)\n")
    assert (place, text) == ("docs/import.md:8", "simulate_fmu('x.fmu', stop_time=0.02)")
