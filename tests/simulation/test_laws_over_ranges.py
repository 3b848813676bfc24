"""Every law and its derivatives are finite all over the declared ranges: at their corners, within, and at rest."""

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.compiled.laws import contact_law, motor_law
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.effect_files import package_effects
from rover_pin.simulation.model.model import base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.traction import TorqueTraction

POINTS = 2000
GEOMETRY = [(-1e-3, 0.045), (-1.0, 1.0), (-1.0, 1.0), (-0.1, 0.1), (-1.0, 1.0), (-5.0, 5.0), (0.0, 1.0)]
"""h [m], v_x, v_y, v_n, rim [m/s], x [m], and the axle."""
PATCH = [0.005, 0.05, 0.0, 0.0, 0.06, 0.0, 0.0]


def drawn(random, bounds, defaults):
    """Return points (numbers, POINTS): each number at an end, at its default, anywhere, or about its default."""
    low, high = np.array(bounds, dtype=float).reshape(-1, 2).T[..., None]
    default = np.array(defaults, dtype=float)[:, None]
    some = random.random((len(default), POINTS))
    about = np.clip(default * 10 ** (4.0 * some - 2.0), low, high)
    ways = np.stack([low + 0.0 * some, high + 0.0 * some, default + 0.0 * some, low + some * (high - low), about])
    return np.take_along_axis(ways, random.integers(0, len(ways), (1, len(default), POINTS)), axis=0)[0]


def of(records, random):
    """Return points of all numbers of records within their declared bounds."""
    bounds = [(spec.low, spec.high) for record in records for spec in quantities(record).values()]
    return drawn(random, bounds, [float(value) for record in records for value in record.values().values()])


def states_of(effects, random):
    """Return points of states: at rest, small, and far along; a slip is 1 at most."""
    names = [state.name for effect in effects for state in effect.states]
    far = [1.0 if name.startswith("S") else 30.0 for name in names]
    return np.array([random.choice([0.0, 1e-9, 1e-3, each / 2, each], POINTS) for each in far]).reshape(-1, POINTS)


def infinite(law, first, states, parameters):
    values = np.array(law.map(POINTS)(first, states, parameters)).reshape(-1, POINTS)
    return ~np.isfinite(values).all(axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()], ids=lambda angles: type(angles).__name__)
@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, Effect)])
def test_what_meets_at_a_wheel_is_finite(kind, angles):
    """Of soils that bear, k_1 + k_2 b > 0, and whose contact is ahead of the axle at its most, |theta_2| < theta_1."""
    random, rover = np.random.default_rng(3), load_rover("nexus6")
    base = [*base_effects(Soil(), rover, SoilTraction(TorqueTraction(), angles)), usual_slip(rover)]
    present = kind in map(type, base) or kind.__name__.endswith("Slip")
    effects = sorted([*base, *([] if present else [kind()])], key=lambda effect: rank(effect))
    wheel, soil = of([Wheel()], random), of([Soil()], random)
    of_soil = dict(zip(quantities(Soil()), soil, strict=True))
    width = wheel[list(quantities(Wheel())).index("b")]
    bears = (of_soil["k_1"] + of_soil["k_2"] * width > 0.0) & (abs(of_soil["theta_2"]) < of_soil["theta_1"])
    first = np.vstack([drawn(random, GEOMETRY, PATCH), wheel, soil])
    wrong = bears & infinite(contact_law(effects), first, states_of(effects, random), of(effects, random))
    assert np.sum(bears) > POINTS / 5
    assert not np.flatnonzero(wrong).size, first[:, np.argmax(wrong)]


def rank(effect):
    """The order of a model's effects: those before the slip, the slip, the others."""
    return 1 if isinstance(effect, RelaxedSlip) else 0 if effect.before_slip else 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, MotorEffect)])
def test_what_a_motor_gives_is_finite(kind):
    random, effects = np.random.default_rng(4), [kind()]
    first = drawn(random, [(-1.0, 1.0), (-20.0, 20.0), (0.0, 5.0), (0.0, 50.0)], [0.5, 1.0, 0.0, 0.5])
    states = states_of(effects, random)
    assert not infinite(motor_law(Motor(), effects), first, states, of([Motor(), *effects], random)).any()
