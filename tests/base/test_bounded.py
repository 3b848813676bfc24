"""Readers take regular files of bounded size, packed and unpacked; devices, pipes and bombs are one sentence."""

import io
import os
import resource
import subprocess
import sys
import tracemalloc
import zipfile

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from rover_pin.base.files.bounded import MIB, array_of, arrays, content, text
from rover_pin.base.files.parquet import unpack_table


def npz(**value):
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **value)
    return buffer.getvalue()


def parquet(table, **options):
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(table, buffer, **options)
    return buffer.getvalue()


def test_a_file_comes_back_whole_up_to_the_bound(tmp_path):
    file = tmp_path / "a"
    file.write_bytes(b"x" * 100)
    assert content(file, 100) == b"x" * 100
    with pytest.raises(OSError, match=r"it.*0 MiB"):
        content(file, 99)
    file.write_bytes("a\r\nb\rä".encode())
    assert text(file) == file.read_text(encoding="utf-8")


def test_a_sparse_file_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "sparse").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(OSError, match=r"it.*1024 MiB"):
        content(tmp_path / "sparse")


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null", "/dev/urandom"])
def test_devices_are_no_files(device):
    with pytest.raises(OSError, match=r"it.*device"):
        content(device)


def test_a_pipe_does_not_keep_the_reader_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match=r"it.*device"):
        content(tmp_path / "pipe")


def test_folders_and_impossible_names(tmp_path):
    with pytest.raises(IsADirectoryError):
        content(tmp_path)
    with pytest.raises(OSError, match=r"file.*name"):
        content("a\0b")
    with pytest.raises(FileNotFoundError):
        content(tmp_path / "none")


def test_arrays_come_back(tmp_path):
    arrays_saved = {"z": np.arange(6.0).reshape(2, 3), "x0": np.array(1)}
    (tmp_path / "a.npz").write_bytes(npz(**arrays_saved))
    values = arrays(tmp_path / "a.npz")
    assert values.keys() == arrays_saved.keys()
    assert all(np.array_equal(values[name], arrays_saved[name]) for name in arrays_saved)


def test_a_bomb_of_arrays_is_not_unpacked(tmp_path):
    (tmp_path / "bomb.npz").write_bytes(npz(z=np.zeros(4 * MIB)))
    assert (tmp_path / "bomb.npz").stat().st_size < 64 * 1024
    with pytest.raises(OSError, match=r"it.*16 MiB"):
        arrays(tmp_path / "bomb.npz", 16 * MIB)


def test_a_shape_that_its_file_does_not_hold_takes_no_memory(tmp_path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1 << 44,)})
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("z.npy", head.getvalue())
    with pytest.raises(ValueError):  # noqa: PT011 - NumPy's words
        arrays(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "shape",
    [(1 << 44,), (1 << 62, 1 << 62), (-1, 3), (3, 5)],
    ids=["large", "beyond integers", "negative", "too large"],
)
def test_an_npy_is_as_large_as_its_header_states(shape):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": shape})
    tracemalloc.start()
    with pytest.raises(ValueError):  # noqa: PT011 - NumPy's words
        array_of(head.getvalue() + bytes(100))
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize(
    "array", [np.arange(6.0).reshape(2, 3), np.asfortranarray(np.eye(3)), np.zeros((0, 3)), np.array(1)]
)
def test_an_npy_comes_back(array, version):
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, version)
    values = array_of(buffer.getvalue())
    assert np.array_equal(values, array)
    assert (values.shape, values.dtype) == (array.shape, array.dtype)


def test_numbers_are_counted_as_the_floats_that_they_become():
    """A million bytes are eight millions as floats."""
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(MIB, dtype=np.uint8))
    assert array_of(buffer.getvalue(), 8 * MIB).size == MIB
    with pytest.raises(OSError, match="7 MiB"):
        array_of(buffer.getvalue(), 7 * MIB)


def test_a_parquet_table_comes_back():
    columns = {"t_s": [0.0, 0.5, None], "run": ["a", None, "a"], "count": [1, 2, 3], "none": [None, None, None]}
    table = pyarrow.table(columns).replace_schema_metadata({b"rover_pin": b"{}"})
    unpacked = unpack_table(parquet(table))
    assert unpacked.to_pydict() == columns
    assert unpacked.schema.metadata[b"rover_pin"] == b"{}"
    assert unpack_table(parquet(table, use_dictionary=False)).to_pydict() == columns


BOMBS = {
    "numbers": (lambda: pyarrow.table({"a": np.zeros(1 << 22)}), "it holds more than 16 MiB"),
    "nothings": (lambda: pyarrow.table({"a": pyarrow.nulls(1 << 22)}), "it holds more than 16 MiB"),
    "texts": (lambda: pyarrow.table({"a": pyarrow.array(["x" * 100_000] * 20)}), "it has a cell of 100000 characters"),
    "words": (
        lambda: pyarrow.table({"a": pyarrow.array(["x" * 100_000]).dictionary_encode().take(np.zeros(9, dtype=int))}),
        "it has a cell of 100000 characters",
    ),
    "cells of text": (
        lambda: pyarrow.table(
            {"a": pyarrow.array(["x" * 1000]).dictionary_encode().take(np.zeros(100_000, dtype=int))}
        ),
        "it holds more than 16 MiB",
    ),
    "bytes": (lambda: pyarrow.table({"a": [b"\xff\x00"] * 9}), "column 'a' holds bytes"),
    "fixed bytes": (
        lambda: pyarrow.table({"a": pyarrow.array([b"ab"] * 9, pyarrow.binary(2))}),
        "column 'a' holds bytes",
    ),
    "lists": (lambda: pyarrow.table({"a": [[0.0] * 100_000] * 9}), "column 'a' holds lists or records"),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_of_a_table_is_not_unpacked(kind):
    built, says = BOMBS[kind]
    packed = parquet(built(), compression="zstd")
    assert len(packed) < 100_000
    with pytest.raises(OSError, match=says):
        unpack_table(packed, 16 * MIB)


LEAN = """
import sys
from pathlib import Path
from rover_pin.base.files.parquet import unpack_table
import pyarrow.parquet, resource
packed = Path(sys.argv[1]).read_bytes()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    unpack_table(packed)
except OSError as error:
    print(error.strerror)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def test_repeated_long_texts_do_not_fill_the_memory(tmp_path):
    """Written out these are 200 GB."""
    table = pyarrow.table(
        {"a": pyarrow.array(["x" * 2_000_000]).dictionary_encode().take(np.zeros(100_000, dtype=int))}
    )
    (tmp_path / "bomb.parquet").write_bytes(parquet(table, compression="zstd"))

    def limited():
        resource.setrlimit(resource.RLIMIT_CPU, (60, 60))

    script = [sys.executable, "-c", LEAN, str(tmp_path / "bomb.parquet")]
    done = subprocess.run(script, capture_output=True, text=True, check=True, preexec_fn=limited)
    outcome, grown = done.stdout.splitlines()
    assert all(number in outcome for number in ("2000000", "1000"))
    assert int(grown) < 200
