"""A sweep on a Dask cluster: parts as Parquet files, every row once, even if workers die.

    client = Client(LocalCluster(n_workers=2, threads_per_worker=1))      # or any other cluster
    sweep(Plan.from_toml("sweep.toml"), None, "results", client)
    table = pyarrow.parquet.read_table("results")

Workers need this package and pyarrow; `out` must be the same location for all of them: a shared folder, or any fsspec location
(s3://..., gs://...).
"""

import json
import multiprocessing
import signal
import time
import uuid
import warnings

import fsspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ._error import FmuError
from ._plan import _columns

__all__ = ["sweep"]

# Work of a part (s): little is lost with a worker, and the overhead of 10 ms per task is negligible.
_WORK = 7.0


def sweep(plan, rows, out, client, chunk=None):
    """Run the rows of a plan on a cluster, and write part-FIRST.parquet for each chunk into `out`.

    Args:
        plan: a Plan; workers open its files at the same paths, or take them from the pickle with `embed=True`
        rows: a table as for `Plan.run_many`; a number of rows, or None for all, of the plan's design
        out: folder of the parts; existing parts are not run again
        client: a `distributed.Client`
        chunk: rows of a part; by default about 7 s of work, timed on the first row

    Parts get their names when they are complete, so that a killed worker leaves none half written, and at most loses the chunk
    it was at. A chunk that kills its worker again and again is run here row by row, each row in a process:
    the row that kills it ends with `error = "killed by SIGSEGV"`.

    Returns:
        {"rows": number of rows, "parts": number of parts, "skipped": parts that were there, "failed": rows with an error in the
        parts that were run, "isolated": chunks that were run row by row}

    Raises:
        FmuError: `out` has parts of another plan or table, or of another cut
    """
    from distributed import KilledWorker, as_completed

    table = None if rows is None or isinstance(rows, (int, np.integer)) else _columns(rows)
    count = len(plan) if rows is None else int(rows) if table is None else len(next(iter(table.values()), []))
    if count < 1:
        raise ValueError("there is no row to run")
    if table is None and count > len(plan):
        raise ValueError(f"the design has {len(plan)} rows, not {count}")
    take = _rows_of(plan, table)
    # Errors that can be found before the first task: names, types, lengths.
    begin = time.perf_counter()
    plan._run_many(take(0, 1), threads=1)
    seconds = time.perf_counter() - begin
    out = str(out).rstrip("/")
    fs, folder = fsspec.core.url_to_fs(out)
    fs.makedirs(folder, exist_ok=True)
    threads = _threads(client)
    if not threads:
        warnings.warn("the cluster has no workers: the sweep waits for the first that joins", stacklevel=2)
    cut = _cut(plan, table, count, chunk or _chunk(seconds, count, threads))
    cut = _agreed(fs, folder, cut)
    chunk = cut["chunk"]
    there = {path.rsplit("/", 1)[-1] for path in fs.ls(folder, detail=False)}
    firsts = [first for first in range(0, count, chunk) if _part(first) not in there]
    report = {"rows": count, "parts": -(-count // chunk), "skipped": -(-count // chunk) - len(firsts), "failed": 0, "isolated": 0}
    tables = {first: None if table is None else take(first, min(chunk, count - first)) for first in firsts}
    # One key per call, so that results of an earlier call in the cluster are not mistaken for those of this call.
    keys = [f"fmurun-{uuid.uuid4().hex[:8]}-{first}" for first in firsts]
    futures = client.map(
        _work, firsts, [min(chunk, count - f) for f in firsts], [tables[f] for f in firsts], plan=plan, out=out, key=keys,
        pure=False, retries=3,
    )  # fmt: skip
    first_of, texts = dict(zip(keys, firsts)), []
    for future in as_completed(futures, raise_errors=False):
        first = first_of[future.key]
        try:
            # Not `status`: a worker that has died has lost the number, and `result` waits for another worker.
            failed, text = future.result()
            report["failed"] += failed
            texts += [text] if text else []
            continue
        except KilledWorker:
            pass
        except Exception as error:
            client.cancel(futures)
            cause = f"{folder}/{_part(first)}: {type(error).__name__}: {error}; the other parts remain, and the sweep resumes"
            raise error if isinstance(error, FmuError) else FmuError(None, None, None, cause) from error
        n = min(chunk, count - first)
        results = _isolated(plan, take(first, n), first)
        _write(fs, folder, first, results)
        report["isolated"] += 1
        report["failed"] += _failed(results)
    if texts:
        more = f"; other parts with warnings: {len(texts) - 1}" if len(texts) > 1 else ""
        warnings.warn(f"{texts[0]}{more}", stacklevel=2)
    return report


def _failed(results):
    """Number of rows with an error: the last column."""
    return sum(bool(error) for error in results[next(reversed(results))])


def _rows_of(plan, table):
    if table is None:
        return plan.rows
    return lambda first, n: {name: np.asarray(column)[first : first + n] for name, column in table.items()}


def _threads(client):
    """Number of threads of the cluster."""
    return sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values())


def _chunk(seconds, count, threads):
    """Rows of about 7 s of work, and at least two parts a thread of the cluster."""
    return max(1, min(int(_WORK / max(seconds, 1e-6)), -(-count // (2 * max(threads, 1)))))


def _part(first):
    return f"part-{first:012}.parquet"


def _cut(plan, table, count, chunk):
    import hashlib
    import pickle

    rows = None if table is None else {name: np.asarray(column).tolist() for name, column in table.items()}
    made_of = pickle.dumps([plan._definition, plan._hashes, rows], protocol=4)
    return {"version": 1, "made_of": hashlib.sha256(made_of).hexdigest(), "rows": count, "chunk": int(chunk)}


def _agreed(fs, folder, cut):
    """The rows per part that `out` has, or these: a resumed sweep has parts of the same size."""
    path = f"{folder}/_sweep.json"
    if not fs.exists(path):
        _publish(fs, path, json.dumps(cut).encode())
        return cut
    old = json.loads(fs.cat_file(path))
    for what, of in (("made_of", "another plan or table"), ("rows", "another number of rows")):
        if old.get(what) != cut[what]:
            cause = f"{folder}: has the parts of {of}; name another folder, or remove this one"
            raise FmuError(None, None, None, cause)
    return old


def _publish(fs, path, data):
    """Write a file under a temporary name, and rename it when it is complete."""
    folder, name = path.rsplit("/", 1)
    partial = f"{folder}/.{name}-{uuid.uuid4().hex}"
    fs.pipe_file(partial, data)
    fs.mv(partial, path)


def _write(fs, folder, first, results):
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(results), sink)
    _publish(fs, f"{folder}/{_part(first)}", sink.getvalue().to_pybytes())


def _work(first, count, table, plan, out):
    """A part, on a worker; returns how many rows have an error, and a warning. It returns no rows, so that none are lost with a worker."""
    fs, folder = fsspec.core.url_to_fs(out)
    if fs.exists(f"{folder}/{_part(first)}"):
        # Written by this sweep and requested again, because the worker that held the number died.
        with fs.open(f"{folder}/{_part(first)}", "rb") as part:
            return sum(map(bool, pq.read_table(part).columns[-1].to_pylist())), None
    results, text = plan._run_many(plan.rows(first, count) if table is None else table, threads=1, first_run=first)
    _write(fs, folder, first, results)
    return _failed(results), text


def _isolated(plan, table, first):
    """Run rows one by one in a child process, and in a new one when it dies."""
    columns = {str(name): column for name, column in _columns(table).items() if name != "run"}
    context = multiprocessing.get_context("spawn")
    n, parts, child, pipe = len(next(iter(columns.values()))), [], None, None
    try:
        for k in range(n):
            if child is None:
                pipe, end = context.Pipe()
                child = context.Process(target=_child, args=(plan, end), daemon=True)
                child.start()
                end.close()
            row = {name: np.asarray(column)[k : k + 1] for name, column in columns.items()}
            try:
                pipe.send((row, first + k))
                parts.append(pipe.recv())
            except (EOFError, OSError):
                child.join()
                parts.append(_dead(plan, row, first + k, child.exitcode))
                child = None
    finally:
        if child is not None:
            child.terminate()
            child.join()
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _child(plan, pipe):
    while True:
        try:
            row, number = pipe.recv()
        except EOFError:
            return
        pipe.send(plan._run_many(row, threads=1, first_run=number)[0])


def _dead(plan, row, number, code):
    """The result of a row that killed its process."""
    cause = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended the process with exit code {code}"
    blank = {"f": np.nan, "i": number, "O": ""}
    missing = {name: np.array([blank[of.dtype.kind]], of.dtype) for name, of in plan.meta(list(row)).items()}
    known = {name: np.asarray(column, missing[name].dtype) for name, column in row.items()}
    return {**missing, **known, next(reversed(missing)): np.array([cause], dtype=object)}
