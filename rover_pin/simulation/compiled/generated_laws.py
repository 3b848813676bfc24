"""The contact, motor and body laws of a model as generated and compiled C code. All models whose effects have equal
classes share one compiled library, whatever the numbers of these effects.
"""

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca

from rover_pin.base.quantity import quantities
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.body_law import body_law
from rover_pin.simulation.compiled.laws import split_law
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native import lanes
from rover_pin.simulation.state import Joints, joints_of

LANE_COUNT_SOURCE = "int law_lanes(void) { return LANES; }\n"
"""C source of a function that returns the number of SIMD lanes of the laws. The step checks that this number equals its
own."""


@dataclass(frozen=True)
class Structure:
    """The properties of a model that decide its generated C code: the classes of its effects and their choices (such as
    the traction form), but not their numbers. Models with equal structure share one compiled library.
    """

    contact: tuple[Any, ...]
    motor: Any
    motor_effects: tuple[Any, ...]
    body_effects: tuple[Any, ...] = ()
    joints: Joints | None = None
    """the suspension's joints if the model has body effects, otherwise None"""


def structure_of(model: Model) -> Structure:
    """Return the properties of a model that decide its generated C code.

    In the result, every quantity of every effect is set to its default. Models that differ only in numbers therefore
    have equal results.
    """

    # Models that differ in numbers only then have one structure, and one compiled library.
    def with_defaults(effects: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(
            effect.replace(**{name: type(effect).__dataclass_fields__[name].default for name in quantities(effect)})
            for effect in effects
        )

    return Structure(
        with_defaults(model.contact_effects),
        type(model.motor)(),
        with_defaults(model.motor_effects),
        with_defaults(model.body_effects),
        joints_of(model.rover) if model.body_effects else None,
    )


class LawsSource(NamedTuple):
    """C source of the laws of a model's effects, with the names of its functions and the sizes of the memory that they
    need.
    """

    text: str
    names: tuple[str, ...]
    """names of the C functions: precomputed part of the contact law, contact law, motor law, and, if the model has body
    effects, body law"""
    held: int
    """number of constants that the precomputed part of the contact law computes for each pair of wheel and soil"""
    work: tuple[int, int]
    "sizes of the integer and of the real work space that the functions need"


class LawFunctions(NamedTuple):
    """The laws of a model's effects as CasADi functions. C code for numbers and C code for dual numbers are generated
    from them.
    """

    before: ca.Function
    """part of the contact law that depends only on wheel, soil and parameters; it is computed before the drive"""
    during: ca.Function
    """rest of the contact law"""
    motor: ca.Function
    """law of the motors"""
    body: tuple[ca.Function, ...]
    """law of the effects on the body; empty if the model has no such effects"""


def law_functions(structure: Structure) -> LawFunctions:
    """Return the laws of a structure of effects as CasADi functions."""
    before, during = split_law(laws.contact_law(structure.contact), len(laws.GEOMETRY))
    motor = laws.motor_law(structure.motor, structure.motor_effects)
    if not structure.body_effects:
        return LawFunctions(before, during, motor, ())
    assert structure.joints is not None
    return LawFunctions(before, during, motor, (body_law(structure.body_effects, structure.joints),))


@lru_cache(maxsize=64)
def laws_source(structure: Structure) -> LawsSource:
    """Return the generated C code of the laws for a structure of effects. All numbers of the effects are parameters of
    the code, so that a change of a number needs no new code.
    """
    before, during, motor, body = law_functions(structure)
    scalar = (before, *body)
    # Contact and motor laws run over SIMD lanes; the motor's parameters (input 2) are the same in all lanes.
    over_lanes = lanes.header() + lanes.c_source(during) + lanes.c_source(motor, shared=[2]) + LANE_COUNT_SOURCE
    names = ("contact_law_before", "contact_law_during", "motor_law", *(f.name() for f in body))
    work = max(f.sz_iw() for f in scalar), max(f.sz_w() for f in scalar)
    return LawsSource(laws.generated_source(*scalar) + over_lanes, names, before.numel_out(0), work)


@dataclass(frozen=True)
class CompiledLaws:
    """Addresses of the compiled C functions for a structure of effects, and the sizes that they need."""

    handle: ctypes.CDLL
    """the loaded library; it is stored here because the addresses are valid only while it is loaded"""
    contact_before: int
    """address of the function that precomputes the constants of the contact law from the numbers of a wheel and a
    soil"""
    contact: int
    motor: int
    body: int
    """address of the body law; 0 if the structure contains no body effect"""
    held: int
    lanes: int
    """number of SIMD lanes: the functions `contact` and `motor` evaluate this number of patches or wheels at once"""
    work: tuple[int, int]
    "sizes of the integer and of the real work space that the functions need"


@lru_cache(maxsize=64)
def compiled_laws(structure: Structure) -> CompiledLaws:
    """Return the compiled laws for a structure of effects. They are compiled at the first call, and loaded from a
    stored library later, so that a sweep over numbers of effects compiles once.
    """
    source = laws_source(structure)
    handle = shared_library(source.text, "laws")
    # Without body effects there is no body law, and its address is 0.
    addresses = [ctypes.cast(getattr(handle, name), ctypes.c_void_p).value or 0 for name in source.names]
    before, contact, motor, body, *_ = [*addresses, 0]
    return CompiledLaws(handle, before, contact, motor, body, source.held, int(handle.law_lanes()), source.work)
