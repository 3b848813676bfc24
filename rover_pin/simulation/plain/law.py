"""The contact law at one patch in NumPy, for a wheel that travels forwards, backwards, or is nearly at rest."""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.kernel import DIRECTION_SPEED
from rover_pin.simulation.model.model import Model

TRAVEL_SIGNS = np.array([-1.0, -1.0, 1.0, -1.0])
"""Signs of (f_t, f_y, f_n, torque), and also of (v_x, v_y, v_n, rim), in the mirror image of a wheel. The mirror image
travels in the opposite direction. Backward travel is computed as such a mirror image of forward travel."""
UNDECIDED = DIRECTION_SPEED / 100.0
"""Minimum speed [m/s] that decides the direction of travel alone. Below this value, travel speed and rim speed
contribute equally; above this value, the faster of the two decides the direction."""


class LawValue(NamedTuple):
    """Output of the contact law at one patch, for nx states of the contact effects at the wheel."""

    load: np.ndarray
    """(4,) tangential force f_t, sideways force f_y, normal force f_n [N], and torque [N m]"""
    by_speed: np.ndarray
    "(4, 4) derivatives of the load by the speeds, d load / d (v_x, v_y, v_n, rim)"
    rate: np.ndarray
    """(nx,) rates of change of the states"""
    rate_by_speed: np.ndarray
    """(nx, 4) derivatives of the rates by the speeds (v_x, v_y, v_n, rim)"""
    load_by_state: np.ndarray
    """(4, nx) derivatives of the load by the states"""
    rate_by_state: np.ndarray
    """(nx, nx) derivatives of the rates by the states"""
    slip: np.ndarray
    """(2,) slip S and sideways slip S_y [-]"""


def direction(v: float, rim: float) -> tuple[float, float, float]:
    """Return the direction of travel z of a wheel, and the derivatives of z by travel speed and rim speed.

    z goes from -1 (backwards) to 1 (forwards) while the speeds go from -DIRECTION_SPEED to DIRECTION_SPEED:

        z = (v |v| + rim |rim| + c (v + rim)) / sqrt(2 (v^2 + rim^2 + UNDECIDED^2)) / DIRECTION_SPEED,
        c = UNDECIDED / sqrt(2).

    z increases with both speeds, equals v / DIRECTION_SPEED if the wheel rolls (rim = v), and depends mostly on the
    faster of the two speeds. The mean of both speeds would not be suitable: driving and braking shear differ at equal
    |S|, so that a sliding wheel with a held motor would change the law by its own turning, and would oscillate on its
    gear for ever.

    Parameters
    ----------
    v, rim : float
        Travel speed of the wheel and speed of its rim [m/s].
    """
    least = UNDECIDED / math.sqrt(2.0)
    top = v * abs(v) + rim * abs(rim) + least * (v + rim)
    bottom = v * v + rim * rim + UNDECIDED**2
    scale = 1.0 / (math.sqrt(2.0 * bottom) * DIRECTION_SPEED)
    slopes = [(2.0 * abs(speed) + least - top * speed / bottom) * scale for speed in (v, rim)]
    return top * scale, slopes[0], slopes[1]


class PlainLaw:
    """The contact law of a model, with all its contact effects, as a function (contact vector, states) -> LawValue.

    The laws of the effects are written for forward travel. Backward travel is computed as the mirror image of forward
    travel. Within DIRECTION_SPEED around rest, the two are blended.
    """

    def __init__(self, model: Model):
        self.law = laws.as_numbers(laws.contact_law(model.contact_effects))
        self.parameters = laws.numbers(model.contact_effects)
        self.odd = np.array(
            [-1.0 if variable.odd else 1.0 for effect in model.contact_effects for variable in effect.states]
        )
        self.last_axle = max(wheel.axle for wheel in model.rover.wheels)

    def __call__(self, contact: np.ndarray, states: np.ndarray) -> LawValue:
        """Return the load at a contact patch and its derivatives, for a wheel that travels forwards, backwards, or is
        nearly at rest.

        Parameters
        ----------
        contact : array
            Contact vector: the numbers of `laws.GEOMETRY`, then the quantities of the wheel and of the soil.
        states : array (nx,)
            States of the contact effects at this wheel.
        """
        # Weight of the forward law: a smooth step over the direction z, from 0 (backwards) to 1 (forwards).
        z, slope_v, slope_rim = direction(float(contact[1]), float(contact[4]))
        z = min(1.0, max(-1.0, z))
        forwards = 0.5 + 0.25 * z * (3.0 - z * z)
        value = self._law_value(self.law(contact, states, self.parameters))
        if forwards == 1.0:
            return value

        # Backwards: speeds along and across change sign, the last axle leads, odd states change sign; then the answer
        # is mirrored back.
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

        # The blend changes with the speeds too; near rest this is the stiffest part of the law.
        turning = 0.75 * (1.0 - z * z) * np.array([slope_v, 0.0, 0.0, slope_rim])
        return blend._replace(
            by_speed=blend.by_speed + np.outer(value.load - turned.load, turning),
            rate_by_speed=blend.rate_by_speed + np.outer(value.rate - turned.rate, turning),
        )

    def _law_value(self, out: np.ndarray) -> LawValue:
        """Return the output column `out` of the contact law as a `LawValue`. The column holds the blocks one after the
        other, each in column-major order.
        """
        nx = len(self.odd)
        shapes = [(4,), (4, 4), (nx,), (nx, 4), (4, nx), (nx, nx), (2,)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(out, ends[:-1])
        return LawValue(*(part.reshape(shape, order="F") for part, shape in zip(parts, shapes, strict=True)))
