"""The compiler is found, its results are kept, and its absence is said in one sentence."""

import ctypes

import pytest

from rover_pin.errors import MissingExtraError
from rover_pin.motion import toolchain

SOURCE = "double twice(double x) { return 2.0 * x; }\n"


def twice(library):
    library.twice.restype, library.twice.argtypes = ctypes.c_double, [ctypes.c_double]
    return library.twice(21.0)


def test_a_source_is_compiled_once(tmp_path, monkeypatch):
    monkeypatch.setenv("ROVER_PIN_CACHE", str(tmp_path))
    assert twice(toolchain.shared_library(SOURCE, "twice")) == 42.0
    (made,) = tmp_path.glob("*.so")
    before = made.stat().st_mtime_ns
    toolchain.shared_library(SOURCE, "twice")
    assert made.stat().st_mtime_ns == before


def test_a_folder_that_cannot_be_written_is_no_obstacle(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("ROVER_PIN_CACHE", str(blocked / "below"))
    assert twice(toolchain.shared_library(SOURCE, "twice")) == 42.0


def test_no_compiler_is_said(monkeypatch):
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    with pytest.raises(MissingExtraError, match=r"install gcc or clang, or the package `ziglang`"):
        toolchain.shared_library(SOURCE, "twice")


def test_a_failing_compiler_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("ROVER_PIN_CACHE", str(tmp_path))
    with pytest.raises(MissingExtraError, match="set CC to one that works"):
        toolchain.shared_library("this is not C\n", "broken")
    assert not list(tmp_path.glob("*.so"))
