"""`Plan`: one run, many runs, pickles, forks, bad tables."""

import os
import pickle
import shutil
import subprocess
import sys
import textwrap
import threading

import numpy as np
import pyarrow as pa
import pytest
from fmurun import FmuError, Plan, simulate_fmu

SPEED = [(0.0, 0.0), (0.01, 50.0)]
MEASURES = {"peak": ("p.speed", "max"), "angle": {"of": "c.theta_est - p.theta_e", "is": "max_abs", "wrap": "2pi"}}


def pair(standard, **more):
    files = {"p": standard / "PmsmPlant.fmu", "c": standard / "SensorlessController.fmu"}
    arguments = {"input": {"c.speed_ref": SPEED}, "stop_time": 0.05, "step_size": 1e-4, "measures": MEASURES}
    return Plan(files, **arguments | more)


@pytest.fixture(scope="module")
def resistances():
    return np.linspace(2.8, 3.2, 40)


def same(one, other):
    assert list(one) == list(other)
    for name in one:
        if one[name].dtype == object:
            assert one[name].tolist() == other[name].tolist()
        else:
            assert one[name].tobytes() == other[name].tobytes(), name


def test_one_fmu_as_simulate_fmu(standard):
    """Where no input is interpolated and no time rounded differently, the two are equal to the last bit."""
    archive, start = standard / "PmsmDrive.fmu", {"speed_ref": 5.0, "plant.motor.R_s": 3.1}
    plan = Plan(archive, start_values=start, stop_time=0.1, step_size=1e-3, output=["speed", "theta_e", "i_a"])
    one = plan.simulate()
    other = simulate_fmu(archive, start_values=start, stop_time=0.1, output_interval=1e-3, output=["speed", "theta_e", "i_a"])
    assert set(one.dtype.names) == set(other.dtype.names)
    assert np.allclose(one["time"], other["time"], rtol=0, atol=1e-12)
    for name in ("speed", "theta_e", "i_a"):
        assert one[name].tobytes() == other[name].tobytes()


def test_the_pair_by_name_by_hand_and_by_terminal(standard):
    by_name = pair(standard).simulate()
    phases = [(f"c.u_{x}", f"p.u_{x}") for x in "abc"] + [(f"p.i_{x}", f"c.i_{x}") for x in "abc"]
    by_hand = pair(standard, connections=phases).simulate()
    assert by_name["p.speed"].max() > 0
    assert by_name["p.speed"].tobytes() == by_hand["p.speed"].tobytes()
    if standard.name == "fmi3":
        terminals = [("p.phases", "c.phases"), ("p.sensor", "c.sensor")]
        by_terminal = pair(standard, connections=[], terminals=terminals).simulate()
        assert by_name["p.speed"].tobytes() == by_terminal["p.speed"].tobytes()


def test_many_runs_are_single_runs(standard, resistances):
    plan = pair(standard, output=["p.speed"])
    runs = plan.run_many({"p.motor.R_s": resistances})
    assert list(runs) == ["run", "p.motor.R_s", "peak", "angle", "end", "error"]
    assert runs["run"].tolist() == list(range(40))
    for k in (0, 17, 39):
        alone = plan.simulate({"p.motor.R_s": resistances[k]})["p.speed"]
        assert runs["peak"][k] == alone.max()
    assert len(set(runs["peak"])) > 1


def test_bits_of_threads_slices_pickles_and_tables(standard, resistances):
    plan = pair(standard)
    whole = plan.run_many({"p.motor.R_s": resistances}, threads=1)
    for threads in (2, 3, 8, None):
        same(plan.run_many({"p.motor.R_s": resistances}, threads=threads), whole)
    parts = [plan.run_many({"p.motor.R_s": resistances[k : k + 7]}, first_run=k) for k in range(0, 40, 7)]
    same({name: np.concatenate([part[name] for part in parts]) for name in whole}, whole)
    same(pickle.loads(pickle.dumps(plan)).run_many({"p.motor.R_s": resistances}), whole)
    structured = np.array([(x,) for x in resistances], dtype=[("p.motor.R_s", float)])
    same(plan.run_many(structured), whole)
    same(plan.run_many(pa.table({"p.motor.R_s": resistances})), whole)
    same(plan.run_many(pa.record_batch({"p.motor.R_s": resistances})), whole)
    same(plan.run_many({"p.motor.R_s": resistances.tolist(), "run": np.arange(40)}), whole)

    class Frame(dict):
        """As a DataFrame of pandas or polars: columns are names, items are columns."""

        columns = property(list)

    same(plan.run_many(Frame({"p.motor.R_s": resistances})), whole)
    backwards = plan.run_many({"p.motor.R_s": resistances[::-1]})
    assert backwards["peak"][::-1].tobytes() == whole["peak"].tobytes()


def test_bad_rows_are_rows(standard, resistances):
    plan = pair(standard)
    good = plan.run_many({"p.motor.R_s": resistances[:6]})
    values = np.insert(resistances[:6], [1, 3, 5], [-1.0, np.nan, 1e308])
    mixed = plan.run_many({"p.motor.R_s": values})
    bad = np.isin(np.arange(9), [1, 4, 7])
    assert [bool(error) for error in mixed["error"]] == bad.tolist(), mixed["error"]
    assert "motor.R_s = -1 is not allowed" in mixed["error"][1]
    assert np.isnan(mixed["peak"][bad]).all()
    assert mixed["peak"][~bad].tobytes() == good["peak"].tobytes()


def test_enumerations_keep_their_names(standard):
    measures = MEASURES | {"estimator": ("c.estimator", "final")}
    plan = pair(standard, measures=measures)
    estimators = ["Rasmussen", "FluxObserver", "99"]
    runs = plan.run_many({"c.estimator": estimators})
    assert runs["c.estimator"].tolist() == estimators
    assert runs["estimator"].tolist() == [*estimators[:2], ""]
    same(plan.run_many({"c.estimator": [1, 15, 99]}), runs)
    same(plan.run_many({"c.estimator": runs["c.estimator"][:2]}), {name: column[:2] for name, column in runs.items()})
    same(plan.meta(["c.estimator"]), {name: column[:0] for name, column in runs.items()})
    assert pa.table(runs)["c.estimator"].to_pylist() == runs["c.estimator"].tolist()


def test_integers_and_items_keep_their_digits(reference):
    archive, wide = reference / "fmi3" / "Feedthrough.fmu", 2**53 + 1
    course = {
        "Int64_input": [(0.0, wide), (0.5, np.int64(-wide))],
        "UInt64_input": [(0.0, 2**64 - 1), (0.5, 2**63 + 1)],
        "Enumeration_input": [(0.0, "Option2"), (0.5, 1)],
        "Boolean_input": [(0.0, True), (0.5, np.bool_(False))],
    }
    times = {"start_time": 0.0, "stop_time": 1.0, "step_size": 0.1}
    outputs = [name.replace("input", "output") for name in course]
    found = Plan(archive, input=course, output=outputs, **times).simulate()
    ends = [[int(found[name][k]) for k in (0, -1)] for name in outputs]
    assert ends == [[wide, -wide], [2**64 - 1, 2**63 + 1], [2, 1], [1, 0]]
    constant = Plan(archive, input={"Int64_input": wide}, start_values={"UInt64_input": 2**64 - 1}, output=outputs, **times)
    assert [int(constant.simulate()[name][-1]) for name in outputs[:2]] == [wide, 2**64 - 1]
    plan = Plan(archive, measures={"last": "Int64_output"}, **times)
    for column in ([wide, 7], [str(wide), "7"], np.array([wide, 7])):
        assert [int(x) for x in plan.run_many({"Int64_input": column})["last"]] == [wide, 7]
    with pytest.raises(ValueError, match="has 9007199254740993 beside numbers of other types"):
        plan.run_many({"Int64_input": [wide, 0.5]})
    with pytest.raises(ValueError, match="comma and colon would begin another point"):
        Plan(archive, input={"String_input": [(0.0, "a"), (0.5, "b, 1:c")]}, **times)
    with pytest.raises(FmuError, match="Enumeration_input = Option3 is not one of Option1, Option2"):
        Plan(archive, input={"Enumeration_input": [(0.0, "Option3")]}, **times)


def test_a_measure_may_be_called_error(standard):
    """It keeps its name, and the column of all results is renamed; a row that fails is reported there."""
    plan, plain = pair(standard, measures={"error": MEASURES["angle"]}), pair(standard)
    runs, expected = (p.run_many({"p.motor.R_s": [2.9, -1.0]}) for p in (plan, plain))
    assert list(runs) == ["run", "p.motor.R_s", "error", "end", "run.error"]
    assert runs["error"].tobytes() == expected["angle"].tobytes()
    assert runs["run.error"].tolist() == expected["error"].tolist() == ["", expected["error"][1]]
    same(plan.meta(["p.motor.R_s"]), {name: column[:0] for name, column in runs.items()})
    with pytest.raises(FmuError, match="gradient: .*R_s = -"):
        plan.gradient({"p.motor.R_s": -1.0})
    with pytest.raises(FmuError, match="measure: run is the column with the number of each run: rename it"):
        pair(standard, measures={"run": "p.speed"})
    with pytest.raises(ValueError, match=r"the measure p\.motor\.R_s has the name of a column of the table: rename"):
        pair(standard, measures={"p.motor.R_s": "p.speed"}).run_many({"p.motor.R_s": [2.9]})


def test_the_pickle_is_small_and_knows_its_files(standard, tmp_path):
    copy = tmp_path / "plant.fmu"
    shutil.copy(standard / "PmsmPlant.fmu", copy)
    plan = Plan(copy, stop_time=0.01, step_size=1e-3, measures={"end_speed": "speed"})
    stored = pickle.dumps(plan)
    assert len(stored) <= 1024
    pickle.loads(stored)
    shutil.copy(standard / "PmsmDrive.fmu", copy)
    with pytest.raises(FmuError, match="differs from the file"):
        pickle.loads(stored)
    copy.unlink()
    with pytest.raises(FmuError, match=r"plant\.fmu: No such file"):
        pickle.loads(stored)


def test_embedded_archives(standard, tmp_path):
    """A process that has never seen the files runs the same."""
    copy = tmp_path / "plant.fmu"
    shutil.copy(standard / "PmsmPlant.fmu", copy)
    plan = Plan(copy, start_values={"u_a": 5.0}, stop_time=0.01, step_size=1e-3, measures={"i": "i_a"}, embed=True)
    (tmp_path / "plan").write_bytes(pickle.dumps(plan))
    expected = plan.run_many({"motor.R_s": [2.0]})["i"][0]
    copy.unlink()
    script = "import pickle, sys; plan = pickle.load(open(sys.argv[1], 'rb')); print(repr(float(plan.run_many({'motor.R_s': [2.0]})['i'][0])))"
    said = subprocess.run([sys.executable, "-c", script, tmp_path / "plan"], capture_output=True, text=True, check=True).stdout
    assert float(said) == expected


def test_the_pair_in_model_exchange_is_the_drive(standard):
    """Coupled, with each sample at its instant, regardless of the communication step: the FMU that contains both."""
    more = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-11, "step_size": 1e-3, "stop_time": 0.1}
    apart = pair(standard, output=["p.speed", "p.i_a", "c.theta_est"], **more).simulate()
    whole = Plan(standard / "PmsmDrive.fmu", input={"speed_ref": SPEED}, output=["speed", "i_a", "theta_est"], **more).simulate()
    worst = max(np.max(np.abs(apart[a] - whole[b])) for a, b in zip(apart.dtype.names, whole.dtype.names))
    print(f"ME   {standard.name} pair in a Plan and PmsmDrive: within {worst:.1e}")
    assert worst <= 1e-9
    assert whole["speed"].max() > 10.0


def test_interfaces_may_be_mixed(standard, resistances):
    """A controller that is integrated, with a plant that steps itself: the bits of Co-Simulation."""
    mixed, plain = pair(standard, fmi_type={"c": "ModelExchange", "p": "CoSimulation"}), pair(standard)
    same(mixed.run_many({"p.motor.R_s": resistances[:5]}), plain.run_many({"p.motor.R_s": resistances[:5]}))
    other = pair(standard, fmi_type={"p": "ModelExchange", "c": "CoSimulation"}, relative_tolerance=1e-11)
    results = [plan.run_many({"p.motor.R_s": resistances[:5]})["peak"] for plan in (other, plain)]
    assert np.allclose(*results, rtol=1e-7)
    again = pickle.loads(pickle.dumps(other))
    same(again.run_many({"p.motor.R_s": resistances[:5]}), other.run_many({"p.motor.R_s": resistances[:5]}))


WRONG = {
    "an interface": (lambda p: pair_of(p, fmi_type="ME"), ValueError, "must be CoSimulation or ModelExchange, not 'ME'"),
    "an FMU of an interface": (lambda p: pair_of(p, fmi_type={"q": "ModelExchange"}), ValueError, "q is not the name of an FMU"),
    "a solver": (lambda p: pair_of(p, solver="Rk45"), ValueError, "solver = 'Rk45': there is no such solver"),
    "a solver of nobody": (lambda p: pair_of(p, solver="RK4"), FmuError, "is for Model Exchange, and no FMU runs so"),
    "a tolerance": (lambda p: pair_of(p, fmi_type="ModelExchange", relative_tolerance=1.0), FmuError, "between 1e-14 and 0.1"),
    "NaN in a column": (lambda p: raised(p.run_many({"p.motor.R_s": [float("nan")]})), FmuError, "motor.R_s"),
    "no row": (lambda p: p.run_many({"p.motor.R_s": []}), ValueError, "the table has no row"),
    "a variable": (lambda p: p.run_many({"p.motor.R": [3.0]}), FmuError, "has no variable motor.R"),
    "an instance": (lambda p: p.run_many({"q.motor.R_s": [3.0]}), FmuError, "the instances are p, c"),
    "a fed input": (lambda p: p.run_many({"c.speed_ref": [3.0]}), FmuError, "is fed by"),
    "a text": (lambda p: p.run_many({"p.motor.R_s": [None]}), (TypeError, FmuError), "must have numbers"),
    "a mixed column": (lambda p: p.run_many({"p.motor.R_s": [3.0, "x"]}), (TypeError, FmuError), "R_s"),
    "two lengths": (lambda p: p.run_many({"p.motor.R_s": [3.0], "p.motor.L_d": [1e-3, 2e-3]}), ValueError, "not of one length"),
    "no column": (lambda p: p.run_many({}), ValueError, "no column"),
    "no table": (lambda p: p.run_many(3), TypeError, "must be a dictionary"),
    "threads": (lambda p: p.run_many({"p.motor.R_s": [3.0]}, threads=0), ValueError, "threads must be at least 1"),
    "two dimensions": (lambda p: p.run_many({"p.motor.R_s": [[3.0]]}), ValueError, "2 dimensions"),
    "no design": (lambda p: p.rows(0, 3), FmuError, "has no design"),
    "an output": (lambda p: pair_of(p, output=["p.sped"]).simulate(), FmuError, "has no variable sped"),
    "a measure": (lambda p: pair_of(p, measures={"m": "p.sped"}), FmuError, "has no variable sped"),
    "a function": (lambda p: pair_of(p, measures={"m": ("p.speed", "maximum")}), ValueError, "^measure m: unknown variant `maximum`, .*, `settling`$"),
    "a measure of nothing": (lambda p: pair_of(p, measures={"m": 3}), TypeError, "the measure m must be"),
    "a step of zero": (lambda p: pair_of(p, step_size=0.0), ValueError, "step_size must be positive"),
    "a stop": (lambda p: pair_of(p, stop_time=float("nan")), ValueError, "stop_time must be finite"),
    "a start value": (lambda p: pair_of(p, start_values={"p.motor.R_s": object()}), TypeError, "must be a number"),
    "an input": (lambda p: pair_of(p, input={"c.speed_ref": "0:x"}), FmuError, "is not a number"),
    "connections": (lambda p: pair_of(p, connections="by name"), ValueError, "by_name"),
    "no file": (lambda p: Plan("missing.fmu"), FmuError, r"missing\.fmu"),
    "no fmus": (lambda p: Plan({}), ValueError, "fmus is empty"),
}


def raised(runs):
    raise FmuError(None, None, None, runs["error"][0])


def pair_of(plan, **more):
    folder = os.path.dirname(plan._definition["fmus"][0].partition("=")[2])
    from pathlib import Path

    return pair(Path(folder), **more)


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_told_before_the_first_run(archives, case):
    call, kind, part = WRONG[case]
    with pytest.raises(kind, match=part):
        call(pair(archives / "fmi3"))


class EnoughError(Exception):
    """Ends runs from their progress."""


def test_python_goes_on_while_runs_do(standard, monkeypatch):
    """Another thread gets its turn during the runs, and they end: with Python's lock held it would wait for the last of them."""
    plan, begun, turns = pair(standard, stop_time=0.2), threading.Event(), []

    def progress(done, rows):
        if turns:
            raise EnoughError

    thread = threading.Thread(target=lambda: begun.wait() and turns.append(True))
    thread.start()
    # A thread that computes keeps the lock, so that the other one has no turn before the runs.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e3)
    try:
        begun.set()
        with pytest.raises(EnoughError):
            plan.run_many({"p.motor.R_s": np.linspace(2.9, 3.1, 20_000)}, threads=1, progress=progress)
    finally:
        sys.setswitchinterval(interval)
    thread.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_leaves_the_parent_intact(standard, resistances):
    plan = pair(standard)
    before = plan.run_many({"p.motor.R_s": resistances[:8]})
    child = os.fork()
    if child == 0:
        ok = plan.run_many({"p.motor.R_s": resistances[:8]}, threads=2)["peak"].tobytes() == before["peak"].tobytes()
        del plan
        os._exit(0 if ok else 1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    same(plan.run_many({"p.motor.R_s": resistances[:8]}), before)


def test_an_interrupt_ends_it(standard, tmp_path):
    """Ctrl-C: KeyboardInterrupt at once, though the runs would take more than ten minutes."""
    script = tmp_path / "long.py"
    script.write_text(textwrap.dedent(f"""
        import signal, threading, time, os
        from fmurun import Plan
        # A shell lets what it starts in the background ignore Ctrl-C.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        plan = Plan({str(standard / "PmsmDrive.fmu")!r}, stop_time=0.2, step_size=1e-3, measures={{"x": "speed"}})
        begin = time.time()
        try:
            threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
            plan.run_many({{"speed_ref": [1.0] * 1000000}}, threads=2)
        except KeyboardInterrupt:
            print("interrupted", time.time() - begin < 60)
    """))
    said = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=600)
    assert said.stdout == "interrupted True\n", said.stderr


def test_rows_of_a_design(standard, tmp_path):
    (tmp_path / "sweep.toml").write_text(textwrap.dedent(f"""
        fmus = ['p={standard / "PmsmPlant.fmu"}', 'c={standard / "SensorlessController.fmu"}']
        auto_connect = true
        stop = 0.02
        step = 1e-4
        [input]
        'c.speed_ref' = '0:0,0.01:50'
        [design]
        kind = 'sobol'
        runs = 20
        seed = 7
        [vary]
        'p.motor.R_s' = {{ uniform = [2.9, 3.1] }}
        'c.motor.R_s' = {{ same = 'p.motor.R_s' }}
        [measure]
        dip = {{ of = 'p.speed', is = 'min' }}
    """))
    plan = Plan.from_toml(tmp_path / "sweep.toml")
    assert len(plan) == 20
    rows = plan.rows(0, 100)
    assert list(rows) == ["run", "p.motor.R_s", "c.motor.R_s"]
    assert rows["run"].tolist() == list(range(20))
    assert rows["c.motor.R_s"].tobytes() == rows["p.motor.R_s"].tobytes()
    later = plan.rows(13, 4)
    assert later["p.motor.R_s"].tobytes() == rows["p.motor.R_s"][13:17].tobytes()
    assert later["run"].tolist() == [13, 14, 15, 16]
    assert len(plan.rows(20, 4)["run"]) == 0
    results = plan.run_many(rows)
    assert not any(results["error"])
    same(plan.meta(), {name: column[:0] for name, column in results.items()})
    assert pa.table(results).schema.names == list(results)
    same(pickle.loads(pickle.dumps(plan)).run_many(later), {name: column[13:17] for name, column in results.items()})


def test_doctests(run_doctests):
    assert run_doctests("fmurun._plan") > 5
