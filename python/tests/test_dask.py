"""Sweeps on a real cluster of processes: a worker killed, a row that kills, another plan in the same folder."""

import os
import signal
import threading
import time
import warnings

import dask
import distributed
import numpy as np
import pyarrow.parquet as pq
import pytest
from distributed import Client, LocalCluster, as_completed
from fmurun import FmuError, Plan
from fmurun.dask import sweep
from poison import Full, Held, Poisoned

ROWS = 4000


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """The folder of `Held`, which the processes of the cluster know."""
    folder = tmp_path_factory.mktemp("held")
    os.environ["FMURUN_HELD"] = str(folder)
    return folder


@pytest.fixture(scope="module")
def cluster(held):
    dask.config.set({"distributed.scheduler.allowed-failures": 1, "distributed.logging.distributed": "critical"})
    with (
        LocalCluster(2, processes=True, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        yield cluster, client


@pytest.fixture
def client(cluster):
    """With both workers: the test before may have killed one, and a sweep without workers waits for some."""
    cluster, client = cluster
    cluster.scale(2)
    client.wait_for_workers(2, timeout=120)
    return client


def drive(archives, make=Plan, **more):
    measures = {"last": "speed", "peak": ("speed", "max_abs"), "rms": ("i_a", "rms")}
    return make(archives / "fmi3" / "PmsmDrive.fmu", start_values={"speed_ref": 20.0}, stop_time=0.05, step_size=1e-3,
                measures=measures, **more)  # fmt: skip


def table(n):
    k = np.arange(n)
    return {"plant.motor.R_s": 2.9 + 0.2 * k / n, "tau_load": 0.1 + k % 7 / 10}


def read(out):
    """All parts together; pyarrow sorts them by their names."""
    table = pq.read_table(out)
    return {name: table[name].to_numpy() for name in table.column_names}


def same(one, other):
    assert list(one) == list(other)
    for name in one:
        assert np.array_equal(one[name], other[name], equal_nan=name != "error"), name


def test_a_killed_worker_loses_no_row(archives, client, held):
    """Every row once, equal to one process, and nothing left behind. The worker is killed at its runs, after five parts."""
    plan, out, killed, pids = drive(archives, Held), held / "out", [], list(client.run(os.getpid).values())

    def kill():
        while not (held / str(pids[0])).exists():
            time.sleep(0.005)
        killed.append(sum(name.startswith("part-") for name in os.listdir(out)))
        os.kill(pids[0], signal.SIGKILL)
        (held / "go").touch()

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    report = sweep(plan, table(ROWS), out, client, chunk=50)
    thread.join()
    assert 5 <= killed[0] < ROWS // 50
    assert report["rows"] == ROWS
    assert report["failed"] == 0
    results = read(out)
    assert results["run"].tolist() == list(range(ROWS))
    same(results, plan.run_many(table(ROWS), threads=2))
    assert not [name for name in os.listdir(out) if name.startswith(".")]
    again = sweep(plan, table(ROWS), out, client)
    assert again["skipped"] == again["parts"] == ROWS // 50


def test_a_worker_that_dies_with_its_number(archives, client, tmp_path, monkeypatch):
    """The number of a finished part is gone before it is read: the number is read from the part, without an error."""

    def after_a_death(futures, **more):
        for future in list(as_completed(futures, **more)):
            if future.status == "finished":
                holder, *_ = client.who_has([future])[future.key]
                pids = client.run(os.getpid)
                # The other worker waits: it would compute the part again before this process sees that the number is gone.
                others = [pid for address, pid in pids.items() if address != holder]
                for pid in others:
                    os.kill(pid, signal.SIGSTOP)
                os.kill(pids[holder], signal.SIGKILL)
                while future.status == "finished":
                    time.sleep(0.001)
                for pid in others:
                    os.kill(pid, signal.SIGCONT)
            yield future

    monkeypatch.setattr(distributed, "as_completed", after_a_death)
    rows = table(4)
    rows["plant.motor.R_s"][2] = -1.0
    report = sweep(drive(archives), rows, tmp_path, client, chunk=4)
    assert (report["failed"], report["isolated"]) == (1, 0)


def test_a_poison_row_ends_as_a_row(archives, client, tmp_path):
    rows = table(60)
    rows["tau_load"][33] = 0.666
    rows["plant.motor.R_s"][5] = -1.0
    report = sweep(drive(archives, Poisoned), rows, tmp_path, client, chunk=20)
    assert report["failed"] == 2
    assert report["isolated"] >= 1
    results = read(tmp_path)
    assert results["run"].tolist() == list(range(60))
    assert results["error"][33] == "killed by SIGSEGV"
    assert "R_s = -1 is not allowed" in results["error"][5]
    expected = drive(archives).run_many(rows)
    good = np.isin(np.arange(60), [5, 33], invert=True)
    for name in ("last", "peak", "rms"):
        assert results[name][good].tobytes() == expected[name][good].tobytes()
        assert np.isnan(results[name][~good]).all()


def test_warnings_of_the_workers_come_back(archives, client, tmp_path):
    rows = {"controller.motor.R_s": [1.8, 1.8, 1.8, 18.0, 18.0, 1.8]}
    with pytest.warns(UserWarning, match=r"1 of 2 rows have warnings; the first, in row [34]: .*; other parts with warnings: 1"):
        sweep(drive(archives), rows, tmp_path, client, chunk=2)


def test_another_plan_or_table_is_refused(archives, client, tmp_path):
    sweep(drive(archives), table(20), tmp_path, client)
    with pytest.raises(FmuError, match="has the parts of another plan or table"):
        sweep(drive(archives), table(21), tmp_path, client)
    with pytest.raises(FmuError, match="has the parts of another plan or table"):
        sweep(drive(archives, sequential=True), table(20), tmp_path, client)


def test_bad_input_is_told_before_the_first_task(archives, client, tmp_path):
    plan = drive(archives)
    for rows, part in (({"R": [1.0]}, "has no variable R"), ({"tau_load": ["x"]}, "tau_load"), ({"tau_load": []}, "no row")):
        with pytest.raises((FmuError, TypeError, ValueError), match=part):
            sweep(plan, rows, tmp_path, client)
    with pytest.raises(FmuError, match="has no design"):
        sweep(plan, 3, tmp_path, client)
    assert os.listdir(tmp_path) == []


def test_a_full_disk_is_told_and_what_is_there_stays(archives, client, tmp_path):
    rows = table(40)
    sweep(drive(archives), rows, tmp_path, client, chunk=20)
    (tmp_path / "part-000000000020.parquet").unlink()
    with pytest.raises(FmuError, match=r"part-000000000020\.parquet: OSError: .*No space.*; the other parts remain"):
        sweep(drive(archives, Full), rows, tmp_path, client)
    assert sweep(drive(archives), rows, tmp_path, client)["skipped"] == 1


def test_map_partitions(archives):
    """The recipe for a Dask DataFrame depends on `meta`."""
    plan = drive(archives)
    empty = plan.meta(["plant.motor.R_s", "tau_load"])
    results = plan.run_many(table(3))
    assert list(empty) == list(results)
    assert {name: column.dtype for name, column in empty.items()} == {name: column.dtype for name, column in results.items()}


def test_a_cluster_without_workers_is_named(archives, tmp_path, monkeypatch):
    """A warning; a worker joins after it, and the sweep runs."""
    said = []
    with (
        LocalCluster(n_workers=0, processes=False, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):

        def show(message, *_):
            said.append(str(message))
            if "has no workers" in said[-1]:
                cluster.scale(1)

        monkeypatch.setattr(warnings, "showwarning", show)
        warnings.simplefilter("always")
        report = sweep(drive(archives), table(20), tmp_path, client)
    assert any("has no workers: the sweep waits" in text for text in said), said
    assert report["rows"] == 20
    assert report["failed"] == 0
