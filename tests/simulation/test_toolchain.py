"""The compiler is found, its results are kept where nobody else writes, and a damaged one is built again."""

import ctypes
import os
import resource
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin.base.errors import CacheError, MissingExtraError, RoverPinError
from rover_pin.base.files import private_folders
from rover_pin.simulation.compiled import toolchain

SOURCE = "double twice(double x) { return 2.0 * x; }\n"
CALLED = f"""
from rover_pin.simulation.compiled.toolchain import shared_library
import ctypes
library = shared_library({SOURCE!r}, "twice")
library.twice.restype, library.twice.argtypes = ctypes.c_double, [ctypes.c_double]
print(library.twice(21.0))
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("ROVER_PIN_CACHE", str(folder))
    return folder


def twice(library):
    library.twice.restype, library.twice.argtypes = ctypes.c_double, [ctypes.c_double]
    return library.twice(21.0)


def called():
    """A process of its own: a library that crashes takes it down, not the tests."""
    return subprocess.Popen([sys.executable, "-c", CALLED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def only(folder):
    (file,) = folder.iterdir()
    return file


def test_a_source_is_compiled_once(cache):
    assert twice(toolchain.shared_library(SOURCE, "twice")) == 42.0
    before = only(cache).stat().st_mtime_ns
    toolchain.shared_library(SOURCE, "twice")
    assert only(cache).stat().st_mtime_ns == before
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700


def flipped(content, at):
    return content[:at] + bytes([content[at] ^ 0x40]) + content[at + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: flipped(content, 30),
        lambda content: flipped(content, len(content) // 2),
        lambda content: bytes(len(content)),
    ],
    ids=["emptied", "halved", "cut short", "head flipped", "middle flipped", "zeroed"],
)
def test_a_damaged_library_is_built_again(cache, damage):
    first_output, _ = called().communicate()
    built_file = only(cache)
    content = built_file.read_bytes()
    built_file.write_bytes(damage(content))
    process = called()
    again, error_output = process.communicate()
    assert (process.returncode, again) == (0, first_output), error_output
    assert only(cache).read_bytes() == content


def test_a_library_that_finds_no_memory_is_kept(cache, monkeypatch):
    toolchain.shared_library(SOURCE, "twice")
    built_file = only(cache)

    def full(file):
        raise OSError(f"{file}: failed to map segment from shared object")

    monkeypatch.setattr(ctypes, "CDLL", full)
    with pytest.raises(MemoryError, match="segment"):
        toolchain.shared_library(SOURCE, "twice")
    assert only(cache) == built_file


def test_processes_that_build_at_once_do_not_disturb_each_other(cache):
    processes = [called() for _ in range(3)]
    for process in processes:
        output, error_output = process.communicate()
        assert (process.returncode, output) == (0, "42.0\n"), error_output
    assert all(file.suffix == ".so" for file in cache.iterdir())


def test_a_folder_to_which_others_can_write_is_refused(cache):
    cache.mkdir()
    cache.chmod(0o777)
    with pytest.raises(CacheError, match=r"it\):.*ROVER_PIN_CACHE"):
        toolchain.shared_library(SOURCE, "twice")
    assert not list(cache.iterdir())


def test_a_folder_of_another_user_is_refused(cache, monkeypatch):
    cache.mkdir(mode=0o700)
    owner = cache.stat().st_uid
    observed = Path.stat
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)

    def others(path, **options):
        metadata = observed(path, **options)
        return os.stat_result((*metadata[:4], owner + 7, *metadata[5:])) if path == cache else metadata

    monkeypatch.setattr(Path, "stat", others)
    with pytest.raises(CacheError, match=rf"\({owner + 7}\)"):
        toolchain.shared_library(SOURCE, "twice")


@pytest.fixture
def default_folders(tmp_path, monkeypatch):
    """The folders where none is named: the user's cache and the system's for temporary files, both of this test."""
    monkeypatch.delenv("ROVER_PIN_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(private_folders.tempfile, "gettempdir", lambda: str(tmp_path))
    (tmp_path / "home").mkdir()
    return tmp_path / "home" / "rover_pin", tmp_path / f"rover_pin-{os.geteuid()}"


@pytest.mark.parametrize("trouble", ["open to others", "no folder"])
def test_an_unfit_usual_folder_gives_way_to_a_private_one(default_folders, trouble):
    home, file = default_folders
    if trouble == "no folder":
        home.write_text("")
    else:
        home.mkdir()
        home.chmod(0o777)
    assert twice(toolchain.shared_library(SOURCE, "twice")) == 42.0
    assert only(file).suffix == ".so"
    assert stat.S_IMODE(file.stat().st_mode) == 0o700
    assert not home.is_dir() or not list(home.iterdir())


def full(tmp_path, monkeypatch):
    """A compiler that says what gcc's assembler says on a full disk."""
    script = tmp_path / "cc"
    script.write_text('#!/bin/sh\necho "as: can\'t write to made.o: No space left on device" >&2\nexit 1\n')
    script.chmod(0o700)
    monkeypatch.setenv("CC", str(script))


def test_a_full_disk_is_one_sentence_and_nothing_is_left(cache, tmp_path, monkeypatch):
    full(tmp_path, monkeypatch)
    with pytest.raises(CacheError, match=r"cache:.*device\):.*ROVER_PIN_CACHE"):
        toolchain.shared_library(SOURCE, "twice")
    assert not list(cache.iterdir())


def test_unwritable_cache_file_is_one_sentence_and_is_removed(cache):
    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))

    script = (
        "from rover_pin.base.errors import RoverPinError\n"
        "from rover_pin.simulation.compiled.toolchain import shared_library\n"
        f"try:\n    shared_library({SOURCE!r}, 'twice')\n"
        "except RoverPinError as error:\n    print(type(error).__name__, len(str(error).splitlines()))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, preexec_fn=small, check=False)
    assert done.stdout in ("CacheError 1\n", "MissingExtraError 1\n"), done.stderr
    assert not list(cache.iterdir())


def test_zig_builds_for_any_processor_of_its_kind(monkeypatch):
    monkeypatch.setattr(toolchain, "program", lambda name: None)
    monkeypatch.setattr(toolchain.importlib.util, "find_spec", lambda name: object())
    assert toolchain.compiler()[-2:] == ["cc", "-mcpu=baseline"]
    assert not [flag for flag in toolchain.FLAGS if flag.startswith(("-march", "-mcpu", "-mtune"))]


def test_a_missing_compiler_is_reported(monkeypatch):
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    with pytest.raises(MissingExtraError, match="ziglang"):
        toolchain.shared_library(SOURCE, "twice")


def test_a_failing_compiler_is_reported(cache):
    with pytest.raises(MissingExtraError, match=r"CC.*works"):
        toolchain.shared_library("this is not C\n", "broken")
    assert not list(cache.iterdir())


def test_a_library_that_is_there_serves_without_a_compiler(cache, monkeypatch):
    """Compiled once, then every compiler is taken away: the same source loads, another one is refused."""
    toolchain.shared_library(SOURCE, "twice")
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    assert twice(toolchain.shared_library(SOURCE, "twice")) == 42.0
    with pytest.raises(MissingExtraError, match="compiler"):
        toolchain.shared_library(SOURCE + "\n", "twice")


def test_a_library_for_another_processor_does_not_serve_without_a_compiler(cache, monkeypatch):
    toolchain.shared_library(SOURCE, "twice")
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    monkeypatch.setattr(toolchain, "level", lambda: "of another processor")
    with pytest.raises(MissingExtraError, match="compiler"):
        toolchain.shared_library(SOURCE, "twice")


def test_a_damaged_library_does_not_serve_without_a_compiler(cache, monkeypatch):
    toolchain.shared_library(SOURCE, "twice")
    # A new file takes the place of the library: this process still runs the old one, which must stay intact.
    damaged = flipped(only(cache).read_bytes(), 2000)
    library = only(cache)
    library.unlink()
    library.write_bytes(damaged)
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    with pytest.raises(MissingExtraError, match="compiler"):
        toolchain.shared_library(SOURCE, "twice")


@pytest.mark.parametrize(("value", "vectors"), [("1", False), ("0", True), ("", True)])
def test_the_portable_mode_compiles_for_every_processor(monkeypatch, value, vectors):
    monkeypatch.setattr(toolchain, "level", lambda: "x86-64-v4")
    monkeypatch.setattr(toolchain, "has_vector_math", lambda: True)
    monkeypatch.setenv("ROVER_PIN_PORTABLE", value)
    assert bool(toolchain.fast_flags(["cc"])) is vectors


def test_a_portable_library_is_kept_apart_from_the_fast_one(cache, monkeypatch):
    monkeypatch.setattr(toolchain, "level", lambda: "x86-64-v3")
    monkeypatch.setattr(toolchain, "has_vector_math", lambda: True)
    stems = set()
    for value in ("0", "1"):
        monkeypatch.setenv("ROVER_PIN_PORTABLE", value)
        monkeypatch.setattr(toolchain, "cached_library", lambda folder, stem: stems.add(stem) or object())
        toolchain.shared_library(SOURCE, "twice")
    assert len(stems) == 2


def test_another_value_of_the_portable_mode_is_refused(cache, monkeypatch):
    monkeypatch.setenv("ROVER_PIN_PORTABLE", "yes")
    with pytest.raises(RoverPinError, match="ROVER_PIN_PORTABLE = 'yes'"):
        toolchain.shared_library(SOURCE, "twice")
