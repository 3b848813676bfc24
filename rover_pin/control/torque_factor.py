"""What a wheel's torque says of its slip: the whole contact law of a model, effects and all, settled at each slip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rover_pin.contact import Contact, Soil, Wheel
from rover_pin.simulation.compiled.laws import amended, loaded
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.soil.sinkage import entry_angle, sinkage

NOWHERE = -1e3
"""x [m] at which no effect of a stretch of ground acts."""
MIDDLE = 1
"""Wheels that have passed before, where an effect asks."""


def torque_factors(model: Model, slips: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return T / (r f_n) [-] of a wheel of a model under an even share of the weight, at slip ratios (n,).

    All contact effects take part, a loss of strength past the peak as well; those with a memory as on fresh sand, a
    relaxed slip where it has settled. The faster of rim and travel runs at 0.05 m/s. Source: section 4.1, T / r over
    the load. Differs from the paper: nothing without effects; those of a stretch of ground are left out.
    """
    wheel, soil, rover = model.rover.wheel, model.soils[0], model.built
    load = rover.mass * rover.gravity / len(rover.wheels)
    h = float(sinkage(entry_angle(load, 0.0, wheel, soil), wheel))
    return np.array([_factor(model, float(S), h, wheel, soil) for S in slips])


def _factor(model: Model, S: float, h: float, wheel: Wheel, soil: Soil) -> float:
    rim, v = (CRUISE_SPEED, CRUISE_SPEED * (1.0 - S)) if S >= 0.0 else (CRUISE_SPEED * (1.0 + S), CRUISE_SPEED)
    at = Contact(0.0, 0.0, h, v, 0.0, 0.0, rim, NOWHERE, MIDDLE, wheel, soil)
    effects = model.contact_effects
    states = [tuple(S if state.name == "S" else 0.0 for state in effect.states) for effect in effects]
    load, _ = loaded(effects, amended(effects, at, states), states)
    return float(load.torque / (wheel.r * load.f_n))
