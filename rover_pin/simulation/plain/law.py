"""The contact law at one patch in plain NumPy, in the direction of travel."""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.kernel import DIRECTION_SPEED
from rover_pin.simulation.model.model import Model

TRAVEL_SIGNS = np.array([-1.0, -1.0, 1.0, -1.0])
"""How (f_t, f_y, f_n, torque) and (v_x, v_y, v_n, rim) change when the direction of travel is mirrored."""


class LawValue(NamedTuple):
    """The contact law at one patch: load, rates, their derivatives, and the slip."""

    load: np.ndarray
    by_speed: np.ndarray
    rate: np.ndarray
    rate_by_speed: np.ndarray
    load_by_state: np.ndarray
    rate_by_state: np.ndarray
    slip: np.ndarray


UNDECIDED = DIRECTION_SPEED / 100.0
"""Speed [m/s] below which travel and rim decide alike where a wheel goes; above it the faster of both does."""


def direction(v: float, rim: float) -> tuple[float, float, float]:
    """Return which way a wheel goes, -1 to 1 over DIRECTION_SPEED, and its slopes with travel and rim speed.

    z = (v |v| + rim |rim| + c (v + rim)) / sqrt(2 (v^2 + rim^2 + UNDECIDED^2)), c = UNDECIDED / sqrt(2): monotone in
    both; v / DIRECTION_SPEED where the wheel rolls (rim = v). The slower hardly matters: were it the mean of both, a
    held wheel that slides would be driven by its own turning and ring on its gear for ever, because driving and braking
    shear differ at the same |S|, and a torque of the soil that falls with the rim's speed drives the rim.
    """
    least = UNDECIDED / math.sqrt(2.0)
    top = v * abs(v) + rim * abs(rim) + least * (v + rim)
    bottom = v * v + rim * rim + UNDECIDED**2
    scale = 1.0 / (math.sqrt(2.0 * bottom) * DIRECTION_SPEED)
    slopes = [(2.0 * abs(speed) + least - top * speed / bottom) * scale for speed in (v, rim)]
    return top * scale, slopes[0], slopes[1]


class PlainLaw:
    """The law of a model's contact effects: (contact vector, own states) -> LawValue."""

    def __init__(self, model: Model):
        self.law = laws.as_numbers(laws.contact_law(model.contact_effects))
        self.parameters = laws.numbers(model.contact_effects)
        self.odd = np.array(
            [-1.0 if variable.odd else 1.0 for effect in model.contact_effects for variable in effect.states]
        )
        self.last_axle = max(wheel.axle for wheel in model.rover.wheels)

    def __call__(self, contact: np.ndarray, states: np.ndarray) -> LawValue:
        """Return the law in the direction of travel, blended smoothly around rest."""
        z, slope_v, slope_rim = direction(float(contact[1]), float(contact[4]))
        z = min(1.0, max(-1.0, z))
        forwards = 0.5 + 0.25 * z * (3.0 - z * z)
        value = self._law_value(self.law(contact, states, self.parameters))
        if forwards == 1.0:
            return value
        mirrored = contact.copy()
        mirrored[[1, 2, 4]] *= -1.0
        mirrored[6] = self.last_axle - contact[6]
        back = self._law_value(self.law(mirrored, self.odd * states, self.parameters))
        sign, odd = TRAVEL_SIGNS, self.odd
        turned = LawValue(
            sign * back.load,
            np.outer(sign, sign) * back.by_speed,
            odd * back.rate,
            np.outer(odd, sign) * back.rate_by_speed,
            np.outer(sign, odd) * back.load_by_state,
            np.outer(odd, odd) * back.rate_by_state,
            -back.slip,
        )
        blend = LawValue(*(forwards * a + (1.0 - forwards) * b for a, b in zip(value, turned, strict=True)))
        turning = 0.75 * (1.0 - z * z) * np.array([slope_v, 0.0, 0.0, slope_rim])
        return blend._replace(
            by_speed=blend.by_speed + np.outer(value.load - turned.load, turning),
            rate_by_speed=blend.rate_by_speed + np.outer(value.rate - turned.rate, turning),
        )

    def _law_value(self, out: np.ndarray) -> LawValue:
        nx = len(self.odd)
        shapes = [(4,), (4, 4), (nx,), (nx, 4), (4, nx), (nx, nx), (2,)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(out, ends[:-1])
        return LawValue(*(part.reshape(shape, order="F") for part, shape in zip(parts, shapes, strict=True)))
