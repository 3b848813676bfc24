"""The slip of a wheel: Eq (1) with a smallest speed, and a relaxed form that is defined at rest."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State
from rover_pin.soil.slip import slip_ratio

SIDEWAYS_SHARE = 0.05
"""Smallest rolling speed that is used for the sideways slip, as a fraction of the sideways speed. It limits the
sideways slip to 1/0.05, at which the shear is saturated long before."""


@dataclass(frozen=True)
class AlgebraicSlip(Effect):
    """The slip ratio of Eq (1) follows the speeds of rim and travel at once; the speed v_0 keeps its denominator from
    zero.

        S = (r omega - v) / max(|r omega|, |v|, v_0), within [-1, 1]

    Differs from the paper: only below the speed v_0, because Eq (1) is undefined at rest. A parked wheel then creeps at
    a fraction of v_0. Use `RelaxedSlip` if a rover has to stay at rest.
    """

    title: ClassVar[str] = "slip ratio"
    meaning: ClassVar[str] = "the slip follows the speeds of rim and travel at once"
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the slip ratio S and the sideways slip S_y, computed from its present speeds."""
        # Eq (1) stays within -1 and 1 by itself except when rim and travel move in opposite directions.
        S = ca.fmin(1.0, ca.fmax(-1.0, slip_ratio(contact.rim, contact.v_x, self.v_0)))
        S_y = contact.v_y / ca.fmax(sliding_speed(contact), self.v_0)
        return contact._replace(S=S, S_y=S_y)


@dataclass(frozen=True)
class RelaxedSlip(Effect):
    """The slip builds up over a length L of travel, so that it is defined at rest and a parked wheel holds a slope
    without creep.

        L ds/dt = r omega - v - max(|r omega|, |v|) s,   S = s + T ds/dt

    In the steady state S obeys Eq (1). At rest the state s keeps its value. T (`damping`) damps the oscillation of the
    rover's mass on the slip. The sideways slip S_y follows the sideways speed by an equal law.

    Source: first-order relaxation with damping at low speed, as for tyres (Pacejka, Tyre and Vehicle Dynamics). Differs
    from the paper: it has Eq (1) only.
    """

    title: ClassVar[str] = "relaxed slip"
    meaning: ClassVar[str] = "slip builds up over a length of travel"
    length: Scalar = quantity(0.031, "m", "assumed: contact length r (theta_1 - theta_2) of Table 1", 1e-4, 1.0, "L")
    damping: Scalar = quantity(0.1, "s", "assumed: the start on the flat hardly rings", 0.0, 10.0, "T")
    states: ClassVar[tuple[State, ...]] = (State("S", odd=True), State("S_y", odd=True))

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the slip ratio S and the sideways slip S_y, computed from the slip states and their
        rates.
        """
        # The rate damps the oscillation of the rover's mass on the slip, which acts like a spring.
        S, S_y = (state + self.damping * rate for state, rate in zip(x, self.rate(contact, Load(), x), strict=True))
        return contact._replace(S=ca.fmin(1.0, ca.fmax(-1.0, S)), S_y=S_y)

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivatives [1/s] of the two slip states, the slip along the wheel and the sideways slip."""
        # Divided by the rolling speed, the equation relaxes over a length of travel; at rest the states stay.
        rolling = ca.fmax(ca.fabs(contact.rim), ca.fabs(contact.v_x))
        along = (contact.rim - contact.v_x - rolling * x[0]) / self.length
        return along, (contact.v_y - sliding_speed(contact) * x[1]) / self.length


def sliding_speed(contact: Contact) -> Scalar:
    """Return the speed [m/s] at which fresh soil comes under the wheel: the largest of the rim speed, the travel speed,
    and a fraction of the sideways speed.
    """
    rolling = ca.fmax(ca.fabs(contact.rim), ca.fabs(contact.v_x))
    return ca.fmax(rolling, SIDEWAYS_SHARE * ca.fabs(contact.v_y))
