"""The visible output: the figure of a notebook, pandas, a progress bar."""

import re

import numpy as np
import pytest
from fmurun import FmuError, Plan, _plot, plot, simulate_fmu


@pytest.fixture(scope="module")
def result(archives):
    start = {"speed_ref": 50.0, "controller.estimator": "FluxObserver"}
    return simulate_fmu(archives / "fmi3" / "PmsmDrive.fmu", start_values=start, stop_time=0.05, output_interval=1e-3,
                        output=["speed", "i_a", "voltage_limited", "controller.estimator"])  # fmt: skip


def test_a_notebook_shows_the_page(result):
    shown = result._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert "http" not in re.sub("http://www.w3.org", "", shown)
    for part in ("speed", "rpm", "i_a"):
        assert part in shown
    assert result["speed"]._repr_html_() is None
    assert result[:0]._repr_html_() is None


def test_speeds_are_in_rpm(result, archives):
    curves = {name: (unit, y) for name, unit, y in _plot.curves(result)}
    assert curves["speed"][0] == "rpm"
    assert np.allclose(curves["speed"][1], result["speed"] * 30 / np.pi)
    plan = Plan({"d": archives / "fmi3" / "PmsmDrive.fmu"}, start_values={"d.speed_ref": 50.0}, stop_time=0.05, step_size=1e-3,
                output=["d.speed", "d.i_a"])  # fmt: skip
    units = {name: unit for name, unit, _ in _plot.curves(plan.simulate())}
    assert units == {"d.speed": "rpm", "d.i_a": "A"}


def test_matplotlib_or_a_line(result):
    try:
        import matplotlib as mpl
    except ImportError:
        with pytest.raises(ImportError, match="pip install matplotlib"):
            plot(result)
        return
    mpl.use("Agg")
    figure = plot(result, ["speed", "i_a"])
    assert [axis.get_ylabel() for axis in figure.axes] == ["[rpm]", "[A]"]


def test_bad_columns_are_told(result):
    with pytest.raises(ValueError, match="has no column sped; it has time, .*; did you mean speed"):
        _plot.curves(result, ["sped"])
    with pytest.raises(TypeError, match="structured array with the column time, not ndarray"):
        _plot.curves(np.zeros(3))


def test_pandas_has_time_and_names(result):
    pandas = pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "time"
    assert set(frame["controller.estimator"]) == {"FluxObserver"}
    assert frame["speed"].iloc[-1] == result["speed"][-1]


def test_progress(archives):
    plan = Plan(archives / "fmi3" / "PmsmDrive.fmu", stop_time=0.01, step_size=1e-3, measures={"x": "speed"})
    seen = []
    plan.run_many({"speed_ref": np.linspace(0, 1, 300)}, progress=lambda done, rows: seen.append((done, rows)))
    assert seen[-1] == (300, 300)
    assert seen == sorted(seen)

    def stop(done, rows):
        raise FmuError(None, None, None, "enough")

    with pytest.raises(FmuError, match="enough"):
        plan.run_many({"speed_ref": np.linspace(0, 1, 300)}, progress=stop)
    assert len(plan.run_many({"speed_ref": [1.0]}, progress=False)["x"]) == 1
