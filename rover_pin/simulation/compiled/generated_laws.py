"""A model's generated laws, compiled once for each structure of effects."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from rover_pin.base.quantity import quantities
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.body_law import Joints, body_law
from rover_pin.simulation.compiled.constant_part import split_law
from rover_pin.simulation.compiled.suspension import joints_of
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native import lanes


@dataclass(frozen=True)
class CompiledLaws:
    """The addresses of the generated laws and the work space they want; `body` is 0 where nothing acts on it.

    The contact law is in two parts: `contact_before` gives the `held` values of a wheel and a soil for `contact`.
    """

    handle: ctypes.CDLL
    contact_before: int
    contact: int
    motor: int
    body: int
    held: int
    lanes: int
    "patches or wheels that `contact` and `motor` take at once"
    work: tuple[int, int]


LANE_COUNT_SOURCE = "int law_lanes(void) { return LANES; }\n"
"Lets the step check that it passes as many lanes."


class LawsSource(NamedTuple):
    """C of a structure's laws, the functions' names in the order of the struct Drive, and what they want."""

    text: str
    names: tuple[str, ...]
    held: int
    work: tuple[int, int]


@lru_cache(maxsize=64)
def laws_source(structure: Any) -> LawsSource:
    """Return the generated laws of this structure; the numbers stay parameters."""
    before, during = split_law(laws.contact_law(structure.contact), len(laws.GEOMETRY))
    motor = laws.motor_law(structure.motor, structure.motor_effects)
    scalar = [before]
    if structure.body_effects:
        assert structure.joints is not None
        scalar.append(body_law(structure.body_effects, structure.joints))
    together = lanes.header() + lanes.c_source(during) + lanes.c_source(motor, shared=[2]) + LANE_COUNT_SOURCE
    names = ("contact_law_before", "contact_law_during", "motor_law", *(f.name() for f in scalar[1:]))
    work = max(f.sz_iw() for f in scalar), max(f.sz_w() for f in scalar)
    return LawsSource(laws.generated_source(*scalar) + together, names, before.numel_out(0), work)


@lru_cache(maxsize=64)
def compiled_laws(structure: Any) -> CompiledLaws:
    """Return the laws of this structure, compiled; a sweep compiles once."""
    source = laws_source(structure)
    handle = shared_library(source.text, "laws")
    at = [ctypes.cast(getattr(handle, name), ctypes.c_void_p).value or 0 for name in source.names]
    body = at[3] if source.names[3:] else 0
    return CompiledLaws(handle, at[0], at[1], at[2], body, source.held, int(handle.law_lanes()), source.work)


@dataclass(frozen=True)
class Structure:
    """What decides the generated code: the classes of the effects and their choices, not their numbers."""

    contact: tuple[Any, ...]
    motor: Any
    motor_effects: tuple[Any, ...]
    body_effects: tuple[Any, ...] = ()
    joints: Joints | None = None


def structure_of(model: Model) -> Structure:
    """Return the model's structure: its effects with every number at the default."""
    return Structure(
        tuple(_plain(effect) for effect in model.contact_effects),
        type(model.motor)(),
        tuple(_plain(effect) for effect in model.motor_effects),
        tuple(_plain(effect) for effect in model.body_effects),
        joints_of(model.rover) if model.body_effects else None,
    )


def _plain(record: Any) -> Any:
    default = {name: type(record).__dataclass_fields__[name].default for name in quantities(record)}
    return record.replace(**default)
