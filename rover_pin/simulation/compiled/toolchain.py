"""Compile generated C code once for the processor of this computer, and store the libraries in a private folder.

Files of damaged libraries are removed from the folder.
"""

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

from rover_pin.base.errors import NO_ROOM, CacheError, MissingExtraError, one_of
from rover_pin.base.extras import install_command
from rover_pin.base.files.private_folders import HINT, private_folders
from rover_pin.base.jobs.safe_environment import bound_memory, program, safe_environment

log = logging.getLogger(__name__)
FLAGS = ("-O3", "-fPIC", "-shared", "-fno-math-errno", "-ffp-contract=off")
"""Options of the compiler. A product and a sum are not fused into one operation (-ffp-contract=off), so that all
processors give equal bits."""
PLAIN_CPU = "-mcpu=baseline"
"""Option of the compiler Zig for code that every processor of this architecture can run. Without this option, Zig
compiles for the processor of this computer only, although another computer may use the same folder of libraries."""
PORTABLE = "ROVER_PIN_PORTABLE"
"""Environment variable for the portable mode. If its value is 1, code is compiled for every processor of this
architecture, without vector instructions and without the vector functions of glibc, so that the same library serves all
computers of one kind."""
SEPARATOR = "\0"
"""Character between the texts of the digest in a library's file name; none of these texts can contain it."""
DISK_FULL = os.strerror(errno.ENOSPC)
"""Words in a compiler's output that report a full disk."""


def compiler() -> list[str] | None:
    """Return the command of a C compiler, or None if there is none. The command is the first existing command of this
    list: $CC, cc, gcc, clang, and the Python package `ziglang`.
    """
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (executable := program(name)):
            return [executable]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", PLAIN_CPU]
    return None


def shared_library(source: str, name: str, options: Sequence[str] = ()) -> ctypes.CDLL:
    """Return the library that is compiled from the C code `source`. If it was compiled before, it is loaded from a
    private folder instead (`private_folders`).

    If there is no compiler, a library that another compiler made earlier from an equal source is used, provided that it
    was made for this processor and for this C library.

    Parameters
    ----------
    source : str
        The C code.
    name : str
        Beginning of the name of the library's file.
    options : sequence of str
        Options of the compiler in addition to FLAGS.

    Raises
    ------
    MissingExtraError
        There is no stored library, and no C compiler or a compiler that fails. The message states how to get a
        compiler.
    CacheError
        No private folder can hold the library.
    """
    # The first digest stands for the library's purpose: machines of different kinds may share a folder.
    wanted = [source, sys.platform, os.uname().machine, level() if uses_vectors() else "", *platform.libc_ver()]
    prefix, command, folders = f"{name}-{_digest(wanted)}", compiler(), private_folders()
    if command is None:
        # Without a compiler, take any stored library with the same purpose, whatever compiler has made it.
        for folder in folders:
            for stem in sorted({file.name.rpartition("-")[0] for file in folder.glob(f"{prefix}-*-*.so")}):
                if (library := cached_library(folder, stem)) is not None:
                    return library
        command = found_compiler()
    # The second digest stands for the compiler and its options.
    stem = f"{prefix}-{_digest([*command, *FLAGS, *options, *fast_flags(command)])}"
    cached = next(filter(None, (cached_library(folder, stem) for folder in folders)), None)
    return cached or build_library(
        folders,
        stem,
        lambda place: _compile_sources(command, {"source.c": source}, place, fast_flags(command), options),
    )


def _digest(words: Sequence[str]) -> str:
    """Return a digest of several texts, 20 hexadecimal digits, as part of a library's file name."""
    return hashlib.sha256(SEPARATOR.join(words).encode()).hexdigest()[:20]


def portable_library(sources: Mapping[str, str], place: Path) -> Path:
    """Compile C files into a library that runs on every processor of this architecture, and return the path of its
    file.

    Parameters
    ----------
    sources : mapping
        Name -> content of each C file.
    place : Path
        Folder of the files and the library.
    """
    return _compile_sources(found_compiler(), sources, place)


def found_compiler() -> list[str]:
    """Return the command of a C compiler (`compiler`).

    Raises MissingExtraError: there is no compiler. The message states how to install one.
    """
    command = compiler()
    if command is None:
        raise MissingExtraError(
            "No C compiler found. The fast simulator is compiled on first use: install gcc, clang or "
            f"the package ziglang (`{install_command('compiler')}`)."
        )
    return command


def fast_flags(command: list[str]) -> list[str]:
    """Return the compiler options that make the laws use the vector instructions of this processor.

    The list is empty if vector instructions cannot be used: in the portable mode, with the compiler Zig, on an unknown
    processor, or if the C library has no vector functions.
    """
    if len(command) > 1 or not uses_vectors():  # zig has its own C library, without libmvec
        return []
    return [f"-march={level()}", "-DLIBMVEC"]


def uses_vectors() -> bool:
    """Return whether code may be compiled for the vector instructions of this processor.

    Raises ParameterError: the environment variable for the portable mode (PORTABLE) is neither 0 nor 1.
    """
    portable = one_of(PORTABLE, os.environ.get(PORTABLE) or "0", ("0", "1")) == "1"
    return not portable and bool(level()) and has_vector_math()


def _compile_sources(
    command: list[str], sources: Mapping[str, str], place: Path, fast: Sequence[str] = (), options: Sequence[str] = ()
) -> Path:
    """Compile C files into a library, and return the path of its file.

    Parameters
    ----------
    command : list of str
        The command of the compiler.
    sources : mapping
        Name -> content of each C file.
    place : Path
        Folder of the C files and the library.
    fast : sequence of str
        Options for vector instructions. If the compiler refuses them, the files are compiled without them.
    options : sequence of str
        Further options.
    """
    log.debug("compiling %d characters of C with %s", sum(map(len, sources.values())), " ".join(command))
    library = place / "made.so"
    for name, source in sources.items():
        (place / name).write_text(source, encoding="utf-8")
    files = [str(place / name) for name in sources if name.endswith(".c")]
    # If the flags for vector functions were given but do not work, the plain command is tried too.
    flags = [*FLAGS, *options]
    tried = [[*flags, *fast, "-o", str(library), *files, "-lmvec"], [*flags, "-o", str(library), *files]]
    for arguments in tried if fast else tried[1:]:
        run = subprocess.run(
            [*command, *arguments, "-lm"], capture_output=True, text=True, check=False,
            cwd=place, env=safe_environment(), preexec_fn=bound_memory,
        )  # fmt: skip
        if run.returncode == 0:
            break
    # A full disk is an error of its own, because another compiler would not help.
    if run.returncode and DISK_FULL in run.stderr:
        raise OSError(errno.ENOSPC, DISK_FULL)
    if run.returncode:
        # The first line with an error is the most informative; a compiler that crashes may print no such line.
        lines = run.stderr.strip().splitlines()
        why = [line for line in lines if "error" in line][:1] or lines[-1:]
        raise MissingExtraError(
            f"The C compiler {' '.join(command)} failed: {why}; set the variable CC to a compiler that works."
        )
    return library


X86_LEVELS = {
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl avx2 bmi1 bmi2 fma f16c abm movbe",
    "x86-64-v3": "avx2 bmi1 bmi2 fma f16c abm movbe",
}
"""Feature levels of x86-64 processors (psABI), the highest first, and for each level the flags that /proc/cpuinfo must
list."""
CPUINFO = Path("/proc/cpuinfo")
VECTOR_MATH = (2, 35)
"""First version of the C library glibc on x86-64 whose vector functions (libmvec) include all functions that the laws
use. With an older version, the laws are computed without vector functions."""


@lru_cache(maxsize=1)
def level() -> str:
    """Return the highest feature level of this processor that the compiler may use (a key of X86_LEVELS). The result is
    an empty string if only the basic level is certain.
    """
    if platform.machine() not in ("x86_64", "AMD64"):
        return ""
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    # The first processor in the list stands for all of them.
    flags = next((set(line.split(":", 1)[1].split()) for line in lines if line.startswith("flags")), set())
    return next((name for name, needs in X86_LEVELS.items() if flags.issuperset(needs.split())), "")


def has_vector_math() -> bool:
    """Return whether the C library has vector versions of the elementary functions (libmvec), such as exp for several
    numbers at once.
    """
    name, version = platform.libc_ver()
    if name != "glibc" or platform.machine() not in ("x86_64", "AMD64"):
        return False
    return tuple(int(part) for part in version.split(".")[:2]) >= VECTOR_MATH


def cached_library(folder: Path, stem: str) -> ctypes.CDLL | None:
    """Return the stored library in a folder whose file name begins with `stem`, or None if there is none. A file that
    cannot be loaded, or whose content does not fit the digest in its name, is removed.
    """
    for file in sorted(folder.glob(f"{stem}-*.so")):
        with contextlib.suppress(OSError):
            if file == _library_file(folder, stem, file.read_bytes()):
                return _load_library(file)
        with contextlib.suppress(OSError):
            file.unlink()
    return None


def build_library(folders: Sequence[Path], stem: str, make: Callable[[Path], Path]) -> ctypes.CDLL:
    """Build a library, store it in the first folder that can hold it, and return it.

    The file's name contains the digest of its content. A single rename therefore puts library and digest in place, even
    if other processes build this library simultaneously.

    Parameters
    ----------
    folders : sequence of Path
        The folders, in the order of the trials.
    stem : str
        Beginning of the file's name.
    make : callable
        Function that builds the library in a folder and returns the path of its file.

    Raises
    ------
    CacheError
        No folder can hold the library, or it cannot be loaded.
    MemoryError
        There is not enough memory to load it.
    """
    # If a folder is full, read-only or mounted without the right to execute, the next folder is tried.
    troubles = []
    for folder in folders:
        try:
            with tempfile.TemporaryDirectory(dir=folder) as place:
                compiled = make(Path(place))
                file = _library_file(folder, stem, compiled.read_bytes())
                os.replace(compiled, file)
            return _load_library(file)
        except OSError as error:
            troubles.append(f"{folder}: {error.strerror or error}")
    raise CacheError(f"Compiled code cannot be kept or loaded ({'; '.join(troubles)}): {HINT}.")


def _load_library(file: Path) -> ctypes.CDLL:
    """Load a library from its file and return it. If there is not enough memory for it, MemoryError is raised instead
    of OSError.
    """
    try:
        return ctypes.CDLL(str(file))
    except OSError as error:
        if NO_ROOM in str(error):
            raise MemoryError(str(error)) from error
        raise


def _library_file(folder: Path, stem: str, content: bytes) -> Path:
    """Return the path of a stored library in a folder. The file name contains a digest of the library's content, so
    that a changed file is detected.
    """
    return folder / f"{stem}-{hashlib.sha256(content).hexdigest()[:32]}.so"
