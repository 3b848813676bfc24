"""A model's two generated laws, compiled once for each structure of effects."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from rover_pin.motion import laws
from rover_pin.motion.model import Model
from rover_pin.motion.toolchain import shared_library
from rover_pin.quantity import quantities


@dataclass(frozen=True)
class CompiledLaws:
    """The addresses of the generated laws and the work space they want."""

    handle: ctypes.CDLL
    contact: int
    motor: int
    work: tuple[int, int]


@lru_cache(maxsize=64)
def compiled_laws(structure: Any) -> CompiledLaws:
    """Return the laws of this structure, compiled; the numbers stay parameters, so a sweep compiles once."""
    functions = (laws.contact_law(structure.contact), laws.motor_law(structure.motor, structure.motor_effects))
    handle = shared_library(laws.generated_source(*functions), "laws")
    contact, motor = (ctypes.cast(getattr(handle, f.name()), ctypes.c_void_p).value or 0 for f in functions)
    return CompiledLaws(
        handle, contact, motor, tuple(max(f.__getattribute__(n)() for f in functions) for n in ("sz_iw", "sz_w"))
    )


@dataclass(frozen=True)
class Structure:
    """What decides the generated code: the classes of the effects and their choices, not their numbers."""

    contact: tuple[Any, ...]
    motor: Any
    motor_effects: tuple[Any, ...]


def structure_of(model: Model) -> Structure:
    """Return the model's structure: its effects with every number at the default."""
    return Structure(
        tuple(_plain(effect) for effect in model.contact_effects),
        type(model.motor)(),
        tuple(_plain(effect) for effect in model.motor_effects),
    )


def _plain(record: Any) -> Any:
    default = {name: type(record).__dataclass_fields__[name].default for name in quantities(record)}
    return record.replace(**default)
