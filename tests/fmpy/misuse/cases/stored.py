"""States as bytes: the same in every process, and checked when they are read."""

import ctypes as c
import hashlib
import random
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

from ..abi import ERROR, OK, Fmu
from ..case import case
from ..run import recovers, refused, run


def stored(fmu, steps=30):
    """An instance after some steps and its state as bytes."""
    it = fmu.instance().begin()
    run(it, steps)
    return it, it.store(it.save())


@case
def stored_state_continues(fmu):
    """In another instance, bit for bit; the bytes depend only on the state, and their size is constant."""
    it, data = stored(fmu)
    assert stored(fmu)[1] == data
    assert len(stored(fmu, 2000)[1]) == len(data)
    other = fmu.instance(b"other")
    status, state = other.recall(data)
    assert status == OK
    assert other.store(state) == data
    assert other.restore(state) == OK
    other.k, other.t = it.k, it.t
    assert run(other, 30) == run(it, 30)


@case
def stored_state_in_another_process(fmu):
    """Written in one process, continued in another, where every address differs."""
    it, data = stored(fmu)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "state").write_bytes(data)
        program = "from misuse.cases.stored import elsewhere; import sys; elsewhere(*sys.argv[1:])"
        command = [sys.executable, "-c", program, str(fmu.folder), folder, str(it.k), str(it.t)]
        subprocess.run(command, check=True)
        assert Path(folder, "trace").read_bytes() == run(it, 30)
        assert Path(folder, "again").read_bytes() == data


def elsewhere(fmu, folder, k, t):
    """The other process of the case above."""
    it = Fmu(fmu).instance()
    status, state = it.recall(Path(folder, "state").read_bytes())
    assert status == OK
    assert it.restore(state) == OK
    Path(folder, "again").write_bytes(it.store(state))
    it.k, it.t = int(k), float(t)
    Path(folder, "trace").write_bytes(run(it, 30))


@case
def stored_state_holds_no_address(fmu):
    """No eight bytes of it are an address of this process's heap, stack or code."""
    it, data = stored(fmu)
    for address in (it.handle, c.cast(it.logger, c.c_void_p).value, c.cast(fmu.library.fmi2Reset, c.c_void_p).value):
        assert address.to_bytes(8, "little")[1:6] not in data


@case
def stored_state_of_another_size(fmu):
    """One byte less, one more, none, null: refused when written and when read."""
    it, data = stored(fmu)
    state, room = it.save(), (c.c_uint8 * (len(data) + 64))()
    for size in (0, 1, len(data) - 1, len(data) + 1):
        assert it.state_call("SerializeFMUState", state, room, size) == ERROR
    assert bytes(room) == bytes(len(room)), "a refused call wrote"
    for size in [*range(64), *range(64, len(data), 17), len(data) - 1]:
        assert it.recall(data[:size])[0] == ERROR, f"cut to {size} bytes"
    for more in (b"\0", b"x", data, bytes(4096)):
        assert it.recall(data + more)[0] == ERROR, f"{len(more)} bytes more"
    assert it.state_call("DeserializeFMUState", None, len(data), c.byref(c.c_void_p())) == ERROR
    recovers(it, run(fmu.instance().begin(), 10))


@case
def flipped_bits(fmu):
    """Each bit of the first bytes and one of every fifth further byte: refused, and the pointer stays null."""
    it, data = stored(fmu)
    for position in (*range(64), *range(64, len(data), 5)):
        for bit in range(8) if position < 64 else [position % 8]:
            broken = bytearray(data)
            broken[position] ^= 1 << bit
            status, state = it.recall(broken)
            assert status == ERROR and not state.value, (position, bit)
        it.messages.clear()
    recovers(it, run(fmu.instance().begin(), 10))


@case
def foreign_bytes(fmu):
    """Zeros, noise, text, a state of the other FMU: refused with a message."""
    it, data = stored(fmu)
    noise = random.Random(1)
    for junk in (b"", b"\0", bytes(len(data)), b"\xff" * len(data), b"hello", noise.randbytes(len(data)), bytes(1_000_000)):
        status, state = it.recall(junk)
        refused(it, status)
        assert not state.value
    for sibling in fmu.folder.parent.parent.glob("*/*/modelDescription.xml"):
        if sibling.parent.name != fmu.folder.name:
            other = Fmu(sibling.parent)
            refused(it, it.recall(stored(other)[1])[0], fmu.identifier)


@case
def forged_bytes(fmu):
    """Random changes with a correct checksum: refused, or a state that runs; no crash, no hang."""
    it, data = stored(fmu)
    dice, body = random.Random(2), data[:-4]
    assert zlib.crc32(body).to_bytes(4, "little") == data[-4:], "the layout has changed: adapt this case"
    accepted = 0
    for _ in range(1000):
        forged = bytearray(body)
        for _ in range(dice.choice((1, 1, 2, 8))):
            forged[dice.randrange(32, len(body))] = dice.choice((0, 1, 0x7F, 0x80, 0xFF, dice.randrange(256)))
        status, state = it.recall(bytes(forged) + zlib.crc32(forged).to_bytes(4, "little"))
        if status == OK:
            if it.restore(state) != OK:  # of an instance for another interface
                assert "FMU state" in it.errors()[0], it.messages
                assert it.call("Reset") == OK
                it.begin()
                it.messages.clear()
                continue
            accepted += 1
            it.step(1e-4, t=it.time()[1])
            assert it.forget(state) == OK
        it.messages.clear()
    assert accepted, "no forgery was plausible: the case tests nothing"
    recovers(it, run(fmu.instance().begin(), 10))


@case
def stored_states_are_frugal(fmu):
    """The bytes of two states differ only where the states differ: the same run twice has one hash."""
    assert len({hashlib.sha256(stored(fmu)[1]).digest() for _ in range(5)}) == 1
