"""A .mat file is read as far as what it unpacks to and what it declares are bounded, its parts too."""

import contextlib
import itertools
import resource
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.cli.app import app
from rover_pin.logs.importing.files.matlab import mat_table

CELL, RECORD, INT8, DOUBLE = 1, 2, 9, 6


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind, dimensions, *parts):
    flags, shape = element(6, struct.pack("<II", kind, 0)), element(5, struct.pack("<2i", *dimensions))
    return element(14, flags + shape + element(1, b"a") + b"".join(parts))


def packed(raw):
    small = zlib.compress(raw, 9)
    return struct.pack("<II", 15, len(small)) + small


NO_FIELDS = struct.pack("<HHI", 5, 4, 32) + element(1, b"")
RECORDS = matrix(RECORD, (100_000_000, 1), NO_FIELDS)
MIB_64 = bytes(64 * bounded.MIB)
NOTHING = {
    "records without fields": RECORDS,
    "records in a packed cell": packed(matrix(CELL, (1, 1), RECORDS)),
    "cells that are not there": matrix(CELL, (2_000_000_000, 1)),
    "numbers that are not there": matrix(DOUBLE, (2_000_000_000, 1), element(9, bytes(80))),
}
BOMBS = {
    "a packed array": packed(matrix(INT8, (len(MIB_64), 1), element(1, MIB_64))),
    "a packed array of one number": packed(matrix(INT8, (1, 1), element(1, MIB_64))),
}


def write(path, elements, order="<"):
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}HH", 0x0100, 0x4D49) + elements)
    return path


@pytest.mark.parametrize("name", NOTHING)
def test_what_a_file_only_declares_takes_no_room(name, tmp_path):
    """A hundred million records in 200 bytes took more than two minutes, and 10 GB."""
    path = write(tmp_path / "run.mat", NOTHING[name])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    told = CliRunner().invoke(app, ["import-log", str(path), "--out", str(tmp_path / "log")]).exception
    assert isinstance(told, DataError)
    assert "no vector of numbers" in str(told) or "its parts do not fit together" in str(told)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 128 * 1024


def test_no_damage_ends_the_program(tmp_path):
    """scipy's reader ended it by a segmentation fault."""
    random, path, wholes = np.random.default_rng(15), tmp_path / "run.mat", []
    table = {"t": np.arange(40.0), "parts": np.arange(80.0).reshape(40, 2), "imu": {"pitch": np.arange(40)}}
    for options in ({"do_compression": True}, {"do_compression": False}, {"format": "4"}):
        savemat(path, dict(itertools.islice(table.items(), 2)) if "format" in options else table, **options)
        wholes.append(path.read_bytes())
    for at in range(1500):
        damaged = bytearray(wholes[at % 3])
        for _ in range(random.integers(1, 5)):
            place, size = random.integers(len(damaged)), random.integers(1, 9)
            damaged[place : place + size] = random.integers(0, 256, random.integers(1, 9), dtype=np.uint8).tobytes()
        path.write_bytes(damaged)
        with contextlib.suppress(DataError):
            mat_table(path)


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_small_file_of_a_large_table_is_refused(bomb, tmp_path, monkeypatch):
    monkeypatch.setattr(bounded, "MOST_UNPACKED", 32 * bounded.MIB)
    path = write(tmp_path / "run.mat", BOMBS[bomb])
    assert path.stat().st_size < bounded.MIB
    told = CliRunner().invoke(app, ["import-log", str(path), "--out", str(tmp_path / "log")]).exception
    assert isinstance(told, DataError)
    assert "it unpacks to more than 32 MiB, which is the most that is read" in str(told)


@pytest.mark.parametrize("options", [{"do_compression": True}, {"do_compression": False}, {"format": "4"}])
def test_what_is_bounded_is_read_as_it_was_written(options, tmp_path):
    t, parts = np.arange(40.0), np.arange(80.0).reshape(40, 2)
    path = tmp_path / "run.mat"
    savemat(path, {"t": t, "parts": parts, "count": np.arange(40, dtype=np.int8)}, **options)
    table = mat_table(path)
    assert sorted(table) == ["count", "parts 1", "parts 2", "t"]
    np.testing.assert_array_equal(table[["t", "parts 1", "parts 2"]], np.column_stack([t, parts]))
