"""What this processor and its C library can do for compiled code."""

import platform
from functools import lru_cache
from pathlib import Path

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
