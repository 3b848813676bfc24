"""Compile generated C once for this processor, and keep the result in a folder that is cleared of what is old."""

import contextlib
import ctypes
import errno
import hashlib
import importlib.util
import logging
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from rover_pin.base.errors import NO_ROOM, CacheError, MissingExtraError
from rover_pin.base.files.private_folders import HINT, private_folders
from rover_pin.base.jobs.safe_environment import bound_memory, program, safe_environment

log = logging.getLogger(__name__)
FLAGS = ("-O3", "-fPIC", "-shared", "-fno-math-errno", "-ffp-contract=off")
PLAIN_CPU = "-mcpu=baseline"
"""Zig builds for this very processor unless set otherwise; a folder of libraries may be shared with another."""
SEPARATOR = "\0"
FULL = os.strerror(errno.ENOSPC)


def compiler() -> list[str] | None:
    """Return the command of a C compiler: $CC, cc, gcc, clang, or the `ziglang` package; None where there is none."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (executable := program(name)):
            return [executable]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", PLAIN_CPU]
    return None


def shared_library(source: str, name: str) -> ctypes.CDLL:
    """Return the library compiled from C `source`, from `private_folders` where the same was compiled before.

    Raises MissingExtraError: there is no C compiler, or it fails; the message says how to get one.
    Raises CacheError: there is no private folder that can hold the library.
    """
    command = found_compiler()
    words = [source, *command, *FLAGS, *fast_flags(command), sys.platform, os.uname().machine, *platform.libc_ver()]
    stem = f"{name}-{hashlib.sha256(SEPARATOR.join(words).encode()).hexdigest()[:20]}"
    folders = private_folders()
    cached = next(filter(None, (cached_library(folder, stem) for folder in folders)), None)
    return cached or build_library(
        folders, stem, lambda place: _compile_sources(command, {"source.c": source}, place, fast_flags(command))
    )


def portable_library(sources: Mapping[str, str], place: Path) -> Path:
    """Return the file of a library of these C files, for any processor of this machine's kind; errors as above."""
    return _compile_sources(found_compiler(), sources, place)


def found_compiler() -> list[str]:
    """Return the command of `compiler`; refuse where there is none."""
    command = compiler()
    if command is None:
        raise MissingExtraError(
            "No C compiler found, and the fast simulator is compiled on first use: install gcc or clang, or "
            "the package `ziglang` (`pip install rover-pin[compiler]`)."
        )
    return command


def fast_flags(command: list[str]) -> list[str]:
    """Return what lets the compiler use this processor's vectors: nothing where elementary functions have none."""
    if len(command) > 1 or not (level() and has_vector_math()):  # zig brings its own C library
        return []
    return [f"-march={level()}", "-DLIBMVEC"]


def _compile_sources(command: list[str], sources: Mapping[str, str], place: Path, fast: Sequence[str] = ()) -> Path:
    log.debug("compiling %d characters of C with %s", sum(map(len, sources.values())), " ".join(command))
    library = place / "made.so"
    for name, source in sources.items():
        (place / name).write_text(source, encoding="utf-8")
    files = [str(place / name) for name in sources if name.endswith(".c")]
    tried = [[*FLAGS, *fast, "-o", str(library), *files, "-lmvec"], [*FLAGS, "-o", str(library), *files]]
    for arguments in tried if fast else tried[1:]:
        run = subprocess.run(
            [*command, *arguments, "-lm"], capture_output=True, text=True, check=False,
            cwd=place, env=safe_environment(), preexec_fn=bound_memory,
        )  # fmt: skip
        if run.returncode == 0:
            break
    if run.returncode and FULL in run.stderr:
        raise OSError(errno.ENOSPC, FULL)
    if run.returncode:
        lines = run.stderr.strip().splitlines()
        why = [line for line in lines if "error" in line][:1] or lines[-1:]
        raise MissingExtraError(f"The C compiler {' '.join(command)} failed: {why}; set CC to one that works.")
    return library


X86_LEVELS = {
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl avx2 bmi1 bmi2 fma f16c abm movbe",
    "x86-64-v3": "avx2 bmi1 bmi2 fma f16c abm movbe",
}
"""Feature levels of the x86-64 psABI, the highest first, and what each needs of /proc/cpuinfo's flags."""
CPUINFO = Path("/proc/cpuinfo")
VECTOR_MATH = (2, 35)
"""The glibc whose libmvec has every function that laws use, on x86-64."""


@lru_cache(maxsize=1)
def level() -> str:
    """Return the highest feature level that this processor has, or nothing where only the plain one is known."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return ""
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    flags = next((set(line.split(":", 1)[1].split()) for line in lines if line.startswith("flags")), set())
    return next((name for name, needs in X86_LEVELS.items() if flags.issuperset(needs.split())), "")


def has_vector_math() -> bool:
    """Return whether the C library has the elementary functions for vectors (libmvec)."""
    name, version = platform.libc_ver()
    if name != "glibc" or platform.machine() not in ("x86_64", "AMD64"):
        return False
    return tuple(int(part) for part in version.split(".")[:2]) >= VECTOR_MATH


def cached_library(folder: Path, stem: str) -> ctypes.CDLL | None:
    """Return the library of this stem, or None; one that is not as it was made, or does not load, is removed."""
    for file in sorted(folder.glob(f"{stem}-*.so")):
        with contextlib.suppress(OSError):
            if file == _library_file(folder, stem, file.read_bytes()):
                return _load_library(file)
        with contextlib.suppress(OSError):
            file.unlink()
    return None


def build_library(folders: Sequence[Path], stem: str, make: Callable[[Path], Path]) -> ctypes.CDLL:
    """Return the library whose file `make(folder)` writes, kept in the first folder that takes it.

    Its name has the digest of its content, so one step puts both in place, whoever else builds it meanwhile.

    Raises CacheError: no folder takes it, or it cannot be loaded. MemoryError: there is no room for it.
    """
    troubles = []
    for folder in folders:
        try:
            return _load_library(_place_library(folder, stem, make))
        except OSError as error:
            troubles.append(f"{folder}: {error.strerror or error}")
    raise CacheError(f"Compiled code cannot be kept or loaded ({'; '.join(troubles)}): {HINT}.")


def _load_library(file: Path) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(str(file))
    except OSError as error:
        if NO_ROOM in str(error):
            raise MemoryError(str(error)) from error
        raise


def _place_library(folder: Path, stem: str, make: Callable[[Path], Path]) -> Path:
    with tempfile.TemporaryDirectory(dir=folder) as place:
        compiled = make(Path(place))
        file = _library_file(folder, stem, compiled.read_bytes())
        os.replace(compiled, file)
    return file


def _library_file(folder: Path, stem: str, content: bytes) -> Path:
    return folder / f"{stem}-{hashlib.sha256(content).hexdigest()[:32]}.so"
