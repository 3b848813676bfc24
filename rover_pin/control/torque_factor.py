"""Torque, pull and sinkage of a wheel at a constant slip in steady state, with all contact effects of a model."""

from collections.abc import Iterator, Sequence

import numpy as np

from rover_pin.contact import Contact, Load
from rover_pin.simulation.compiled.laws import amend_subject, load_and_rates
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.soil.sinkage import entry_angle, sinkage

OUTSIDE_STRETCHES = -1e3
"""Position x of the wheel [m] in this file's computations. Effects that belong to a stretch of the ground do not act at
this position."""
MAX_TRAVELLING_SLIP = 0.95
"""Maximum slip at which `pull_factors` evaluates the pull [-]. A larger slip gets the pull at this slip, because a
wheel that does not travel has no motion resistance, and would seem to pull harder."""
WHEELS_BEFORE = 1
"""Number of wheels that have passed the ground before this wheel, as for a wheel of the middle axle. Effects of
multiple passes need this number."""


def torque_factors(model: Model, slips: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the torque factors T / (r f_n) [-] of a model's wheel at slip ratios (n,), as an array (n,).

    T is the torque of the soil on the wheel, r the radius of the wheel, and f_n its normal force. An on-board slip
    estimate compares these factors with the measured ones.

    The wheel carries an equal share of the rover's weight. All contact effects of the model act, except effects that
    belong to a stretch of the ground. Effects with a memory act as on fresh sand, and the slip has settled. The larger
    of rim speed and travel speed is 0.05 m/s.

    Source: section 4.1, T / r divided by the load. Differs from the paper: not at all for a model without further
    effects.
    """
    return np.array([float(load.torque / (model.rover.wheel.r * load.f_n)) for load in _steady_loads(model, slips)])


def pull_factors(model: Model, slips: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the pull factors f_t / f_n [-] of a model's wheel at slip ratios (n,), as an array (n,).

    f_t is the pull of the wheel in its direction of travel, and f_n its normal force.

    The wheel is in the state that `torque_factors` describes. Motion resistances are subtracted. A slip above
    `MAX_TRAVELLING_SLIP` gets the pull at `MAX_TRAVELLING_SLIP`: a wheel that does not move has no motion resistance,
    and a forecast with this higher pull would predict that every stuck rover comes free.
    """
    return np.array(
        [float(load.f_t / load.f_n) for load in _steady_loads(model, np.minimum(slips, MAX_TRAVELLING_SLIP))]
    )


def standing_sinkage(model: Model) -> float:
    """Return the sinkage [m] of a model's wheel at a slip of 0, if the wheel carries an equal share of the rover's
    weight.
    """
    wheel, rover = model.rover.wheel, model.built
    return float(
        sinkage(entry_angle(rover.mass * rover.gravity / len(rover.wheels), 0.0, wheel, model.soils[0]), wheel)
    )


def _steady_loads(model: Model, slips: Sequence[float] | np.ndarray) -> Iterator[Load]:
    """Yield the forces and the torque of the soil on a wheel at each slip ratio, with all contact effects of a
    model.
    """
    wheel, soil, h = model.rover.wheel, model.soils[0], standing_sinkage(model)
    effects = model.contact_effects
    # Every contact has the sinkage of a standing wheel; the faster of rim and travel has the cruise speed.
    for S in np.asarray(slips, dtype=float).tolist():
        # Eq (1), solved for both speeds.
        rim, v = (CRUISE_SPEED, CRUISE_SPEED * (1.0 - S)) if S >= 0.0 else (CRUISE_SPEED * (1.0 + S), CRUISE_SPEED)
        # The model's slip law sets S of the contact: from these speeds, or from its state, which has settled at S.
        contact = Contact(0.0, 0.0, h, v, 0.0, 0.0, rim, OUTSIDE_STRETCHES, WHEELS_BEFORE, wheel, soil)
        states = [tuple(S if state.name == "S" else 0.0 for state in effect.states) for effect in effects]
        yield load_and_rates(effects, amend_subject(effects, contact, states), states)[0]
