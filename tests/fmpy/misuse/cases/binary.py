"""The binary itself: its exports, its memory and its side effects."""

import _ctypes
import os
import struct
import sys
from pathlib import Path

from ..abi import OK
from ..case import case
from ..run import alone, run
from ..signatures import ALL

EXTRA = {"fmu_description"}


def defined_symbols(path):
    """Names of the global symbols that a 64-bit ELF library defines: `nm -D --defined-only` without nm."""
    data = path.read_bytes()
    assert data[:5] == b"\x7fELF\x02", "a 64-bit ELF file"
    (sections,), (size, count) = struct.unpack_from("<Q", data, 0x28), struct.unpack_from("<HH", data, 0x3A)
    headers = [struct.unpack_from("<IIQQQQIIQQ", data, sections + i * size) for i in range(count)]
    dynsym = next(h for h in headers if h[1] == 11)
    names = headers[dynsym[6]][4]
    found = set()
    for offset in range(dynsym[4], dynsym[4] + dynsym[5], 24):
        name, info, _, section, _, _ = struct.unpack_from("<IBBHQQ", data, offset)
        if info >> 4 in (1, 2, 10) and section != 0:
            found.add(data[names + name : data.index(b"\0", names + name)].decode())
    return found


def resident():
    """Resident memory of this process in bytes; 0 where it cannot be read."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


def unload(fmu):
    """Unloads the binary."""
    handle, fmu.library = fmu.library._handle, None
    (_ctypes.FreeLibrary if sys.platform == "win32" else _ctypes.dlclose)(handle)


@case
def exports(fmu):
    """All functions of both standards and the description; nothing else."""
    for name in ALL:
        assert getattr(fmu.library, name), name
    if sys.platform.startswith("linux"):
        found = defined_symbols(fmu.path)
        assert found == set(ALL) | EXTRA, f"missing: {set(ALL) - found}, too many: {found - set(ALL) - EXTRA}"


@case(witness=False)
def load_and_unload(fmu):
    """Three hundred cycles of load, run and unload: unmapped each time, no memory leak, the same run."""
    trace = alone(fmu, 10)
    for cycle in range(300):
        it = fmu.instance().begin()
        assert run(it, 10) == trace
        it.fail()
        it.forget(it.save() if it.call("Reset") == OK else None)
        it.free()
        unload(fmu)
        if sys.platform.startswith("linux"):
            assert str(fmu.path) not in Path("/proc/self/maps").read_text(), "the binary stays in memory"
        fmu.load()
        if cycle == 100:
            before = resident()
    assert resident() - before < 1_000_000, f"{(resident() - before) / 200:.0f} bytes per cycle"


@case
def instances_are_freed(fmu):
    """Thousands of instances, with errors and saved states: no memory leak."""
    for n in range(1500):
        it = fmu.instance()
        it.begin()
        run(it, 2)
        state = it.save()
        status, stored = it.recall(it.store(state))
        assert status == OK
        it.fail()
        assert it.restore(state) == OK
        assert it.forget(state) == OK and it.forget(stored) == OK
        it.free()
        if n == 500:
            before = resident()
    assert resident() - before < 1000 * 256, f"{(resident() - before) / 1000:.0f} bytes per life"


@case
def nothing_is_opened(fmu):
    """A complete run opens no file and no socket, and does not change directory, locale and umask."""
    folder = Path("/proc/self/fd")
    before = (sorted(os.listdir(folder)) if folder.exists() else None, os.getcwd(), os.umask(0o22), dict(os.environ))
    it = fmu.instance().begin()
    run(it)
    it.fail()
    it.free()
    after = (sorted(os.listdir(folder)) if folder.exists() else None, os.getcwd(), os.umask(0o22), dict(os.environ))
    assert before[1:2] + before[3:] == after[1:2] + after[3:]
    assert after[2] == 0o22
    assert before[0] == after[0]
