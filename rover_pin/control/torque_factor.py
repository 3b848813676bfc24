"""What a wheel's torque says of its slip: the whole contact law of a model, effects and all, settled at each slip."""

from collections.abc import Iterator, Sequence

import numpy as np

from rover_pin.contact import Contact, Load
from rover_pin.simulation.compiled.laws import amend_subject, load_and_rates
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.soil.sinkage import entry_angle, sinkage

NOWHERE = -1e3
"""x [m] at which no effect of a stretch of ground acts."""
LOCKED_UP = 0.95
"""Slip up to which a wheel counts as travelling."""
MIDDLE = 1
"""Wheels that have passed before, where an effect asks."""


def torque_factors(model: Model, slips: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return T / (r f_n) [-] of a wheel of a model under an even share of the weight, at slip ratios (n,).

    All contact effects take part, a loss of strength past the peak as well; those with a memory as on fresh sand, a
    relaxed slip where it has settled. The faster of rim and travel runs at 0.05 m/s. Source: section 4.1, T / r over
    the load. Differs from the paper: nothing without effects; those of a stretch of ground are left out.
    """
    return np.array([float(load.torque / (model.rover.wheel.r * load.f_n)) for load in _loads(model, slips)])


def pull_factors(model: Model, slips: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return f_t / f_n [-] of the same wheel, resistances included; at S above `LOCKED_UP` as at it.

    A wheel that does not travel meets no motion resistance, which would hold one there that does not come free.
    """
    return np.array([float(load.f_t / load.f_n) for load in _loads(model, np.minimum(slips, LOCKED_UP))])


def standing_sinkage(model: Model) -> float:
    """Return h [m] of that wheel at S = 0."""
    wheel, rover = model.rover.wheel, model.built
    return float(
        sinkage(entry_angle(rover.mass * rover.gravity / len(rover.wheels), 0.0, wheel, model.soils[0]), wheel)
    )


def _loads(model: Model, slips: Sequence[float] | np.ndarray) -> Iterator[Load]:
    wheel, soil, h = model.rover.wheel, model.soils[0], standing_sinkage(model)
    effects = model.contact_effects
    for S in np.asarray(slips, dtype=float).tolist():
        rim, v = (CRUISE_SPEED, CRUISE_SPEED * (1.0 - S)) if S >= 0.0 else (CRUISE_SPEED * (1.0 + S), CRUISE_SPEED)
        at = Contact(0.0, 0.0, h, v, 0.0, 0.0, rim, NOWHERE, MIDDLE, wheel, soil)
        states = [tuple(S if state.name == "S" else 0.0 for state in effect.states) for effect in effects]
        yield load_and_rates(effects, amend_subject(effects, at, states), states)[0]
