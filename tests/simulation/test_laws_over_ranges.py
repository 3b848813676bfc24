"""Laws and their derivatives are finite within all declared bounds: intervals prove it for all points, and many points
confirm it.
"""

import casadi as ca
import numpy as np
import pytest

from rover_pin import Motor, Soil, Wheel, load_rover
from rover_pin.base.quantity import quantities
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.laws import contact_law, motor_law
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.effect_files import package_effects
from rover_pin.simulation.model.model import base_effects
from rover_pin.soil import stress, wheel_forces
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import TorqueTraction
from tests.simulation.intervals import LARGEST, evaluate

POINTS = 2000
GEOMETRY = [(-1e-3, 0.045), (-1.0, 1.0), (-1.0, 1.0), (-0.1, 0.1), (-1.0, 1.0), (-5.0, 5.0), (0.0, 1.0)]
"""h [m], v_x, v_y, v_n, rim [m/s], x [m], and the axle."""
PATCH = [0.005, 0.05, 0.0, 0.0, 0.06, 0.0, 0.0]
MOTOR = [(-1.0, 1.0), (-20.0, 20.0), (0.0, 5.0), (0.0, 50.0)]
"""Duty, rate [rad/s], wheel and current of the bus [A]."""
FARTHEST = 30.0
"""Of a state; a slip is 1 at most."""
KINDS = [kind for kind in package_effects() if issubclass(kind, Effect)]
TOO_LOOSE = {"CombinedShear", "HardPatch", "PeakStress", "Ploughing", "SkidSinkage", "SlipSinkage", "SlipSoftening"}
"""Whose intervals are too wide to tell anything: points alone speak for them."""
IN_PIECES = {"Bulldozing": "phi", "FlankPressure": "phi_f"}
"""Which number's range is cut into PIECES, where a law holds it twice."""
PIECES = 64


def drawn(random, bounds, defaults):
    """Return points (numbers, POINTS): each number is at a bound, at its default, near its default, or anywhere."""
    low, high = np.array(bounds, dtype=float).reshape(-1, 2).T[..., None]
    default = np.array(defaults, dtype=float)[:, None]
    some = random.random((len(default), POINTS))
    clipped = np.clip(default * 10 ** (4.0 * some - 2.0), low, high)
    ways = np.stack([low + 0.0 * some, high + 0.0 * some, default + 0.0 * some, low + some * (high - low), clipped])
    return np.take_along_axis(ways, random.integers(0, len(ways), (1, len(default), POINTS)), axis=0)[0]


def ranges(records):
    return [(spec.low, spec.high) for record in records for spec in quantities(record).values()]


def of(records, random):
    """Return points of all numbers of some records, within their declared bounds."""
    return drawn(random, ranges(records), [float(value) for record in records for value in record.values().values()])


def states_of(effects, random):
    """Return points of states: at rest, small, and large. A slip is at most 1."""
    names = [state.name for effect in effects for state in effect.states]
    distant = [1.0 if name.startswith("S") else FARTHEST for name in names]
    return np.array([random.choice([0.0, 1e-9, 1e-3, largest / 2, largest], POINTS) for largest in distant]).reshape(
        -1, POINTS
    )


def infinite(law, first, states, parameters):
    values = np.array(law.map(POINTS)(first, states, parameters)).reshape(-1, POINTS)
    return ~np.isfinite(values).all(axis=0)


def at_a_wheel(kind, angles):
    """Return the usual effects of a wheel and one further effect, in the order of a model."""
    rover = load_rover("nexus6")
    base = [*base_effects(Soil(), rover, SoilTraction(TorqueTraction(), angles)), usual_slip(rover)]
    present = kind in map(type, base) or kind.__name__.endswith("Slip")
    return sorted([*base, *([] if present else [kind()])], key=rank)


def outcome(law, bounds, cut=None):
    """Return the interval of a law's values within these bounds, one of which is divided into pieces, and the
    faults.
    """
    boxes = np.repeat(np.array(bounds, dtype=float).T[:, :, None], 1 if cut is None else PIECES, axis=2)
    if cut is not None:
        ends = np.linspace(*bounds[cut], PIECES + 1)
        boxes[:, cut] = ends[:-1], ends[1:]
    return evaluate(law, boxes)


def bounds_of_states(effects):
    names = [state.name for effect in effects for state in effect.states]
    return [(-1.0, 1.0) if name.startswith("S") else (0.0, FARTHEST) for name in names]


BOTH = pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()], ids=lambda angles: type(angles).__name__)


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("kind", KINDS)
def test_no_wheel_divides_by_zero(kind, angles, monkeypatch):
    """No law divides by 0, or takes a root or logarithm outside its domain, if soil and contact bear a load: k_1 + k_2
    b > 0 and f_n > 0.
    """
    modulus, assemble = stress.modulus, wheel_forces.assemble
    monkeypatch.setattr(stress, "modulus", lambda wheel, soil: ca.fmax(modulus(wheel, soil), 1e-7))
    monkeypatch.setattr(wheel_forces, "assemble", lambda *parts: bearing(assemble(*parts)))
    effects = at_a_wheel(kind, angles)
    numbers = [*ranges([Wheel(), Soil()]), *bounds_of_states(effects), *ranges(effects)]
    names = [name for record in (Wheel(), Soil()) for name in quantities(record)]
    names += [state.name for effect in effects for state in effect.states]
    names += [name for effect in effects for name in quantities(effect)]
    cut = len(GEOMETRY) + names.index(IN_PIECES[kind.__name__]) if kind.__name__ in IN_PIECES else None
    assert bool(outcome(contact_law(effects), [*GEOMETRY, *numbers], cut)[1]) == (kind.__name__ in TOO_LOOSE)


def bearing(forces):
    return forces._replace(f_n=ca.fmax(forces.f_n, 1e-9))


@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, MotorEffect)])
def test_no_motor_divides_by_zero_or_overflows(kind):
    effects = [kind()]
    bounds = [*MOTOR, *bounds_of_states(effects), *ranges([Motor(), *effects])]
    values, faults = outcome(motor_law(Motor(), effects), bounds)
    assert not faults
    assert np.abs(values).max() < 1e-3 * LARGEST


def test_a_fault_is_seen():
    """A division by a number that may be 0 is a fault, and a division by a number that is never 0 is none."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    for value, sound in ((x / y, False), (ca.log(x), False), (ca.sqrt(x - 2), False), (x / ca.fmax(y, 1e-3), True),
                         (ca.acos(ca.fmin(1, ca.fmax(-1, x * y))), True), (x**0.5 / (1 + y * y), True)):  # fmt: skip
        assert bool(outcome(ca.Function("f", [x, y], [value]), [(0.0, 3.0), (-1.0, 2.0)])[1]) != sound


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.__name__ in ("CombinedShear", "ExitAngle")])
def test_intervals_contain_the_values_of_a_law(kind):
    """The boxes around the points are a millionth of a range wide, which is narrow enough to decide every branch."""
    random, effects = np.random.default_rng(6), at_a_wheel(kind, FixedAngles())
    first = np.vstack([drawn(random, GEOMETRY, PATCH), of([Wheel()], random), of([Soil()], random)])
    states, parameters = states_of(effects, random), of(effects, random)
    law, points = contact_law(effects), np.vstack([first, states, parameters])
    size = 1e-6 * np.ptp(
        np.array([*GEOMETRY, *ranges([Wheel(), Soil()]), *bounds_of_states(effects), *ranges(effects)]), axis=1
    )
    shift = size[:, None] * random.random(points.shape)
    (low, high), _ = evaluate(law, np.array([points - shift, points + size[:, None] - shift]))
    values = np.array(law.map(POINTS)(first, states, parameters)).reshape(-1, POINTS)
    assert (((low <= values) & (values <= high)) | ~np.isfinite(values)).all()
    assert np.mean(high / 2 - low / 2 < 0.05 * np.abs(values)) > 0.1, "not all so wide that they would hold anything"


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("kind", KINDS)
def test_all_effects_at_a_wheel_are_finite(kind, angles):
    """The soils bear a load, k_1 + k_2 b > 0, and the deepest point of the contact lies ahead of the axle, |theta_2| <
    theta_1.
    """
    random, effects = np.random.default_rng(3), at_a_wheel(kind, angles)
    wheel, soil = of([Wheel()], random), of([Soil()], random)
    of_soil = dict(zip(quantities(Soil()), soil, strict=True))
    width = wheel[list(quantities(Wheel())).index("b")]
    bears = (of_soil["k_1"] + of_soil["k_2"] * width > 0.0) & (abs(of_soil["theta_2"]) < of_soil["theta_1"])
    first = np.vstack([drawn(random, GEOMETRY, PATCH), wheel, soil])
    wrong = bears & infinite(contact_law(effects), first, states_of(effects, random), of(effects, random))
    assert np.sum(bears) > POINTS / 5
    assert not np.flatnonzero(wrong).size, first[:, np.argmax(wrong)]


def rank(effect):
    """Return the rank of an effect in the order of a model: effects before the slip, the law of slip, all other
    effects.
    """
    return 1 if isinstance(effect, RelaxedSlip) else 0 if effect.before_slip else 2
