"""The slip of a wheel: Eq (1) as it stands, and a relaxed form that can stand still."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State
from rover_pin.soil.slip import slip_ratio

SIDEWAYS_SHARE = 0.05
"""A wheel that only slides sideways reaches S_y = 1/0.05: the shear is saturated long before."""


@dataclass(frozen=True)
class AlgebraicSlip(Effect):
    """Eq (1), its denominator kept from zero: S = (r omega - v) / max(|r omega|, |v|, v_0), within [-1, 1].

    Differs from the paper: only below the speed v_0, where Eq (1) is undefined at rest. A parked wheel then creeps at a
    fraction of v_0; use `RelaxedSlip` where standing still matters.
    """

    title: ClassVar[str] = "slip ratio"
    meaning: ClassVar[str] = "the slip follows the speeds of rim and travel at once"
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Set S and S_y from the speeds."""
        S = ca.fmin(1.0, ca.fmax(-1.0, slip_ratio(contact.rim, contact.v_x, self.v_0)))
        S_y = contact.v_y / ca.fmax(sliding_speed(contact), self.v_0)
        return contact._replace(S=S, S_y=S_y)


@dataclass(frozen=True)
class RelaxedSlip(Effect):
    """Slip that builds up over a length of travel: L ds/dt = r omega - v - max(|r omega|, |v|) s, S = s + T ds/dt.

    Its steady state is Eq (1); at rest s keeps its value, so that a parked wheel holds a slope without creeping, and
    nothing is singular. T damps the swing of the rover's mass on the slip. S_y follows the sideways speed likewise.
    Source: first-order relaxation with low-speed damping, as for tyres (Pacejka, Tyre and Vehicle Dynamics).
    Differs from the paper: it has Eq (1) only.
    """

    title: ClassVar[str] = "relaxed slip"
    meaning: ClassVar[str] = "slip builds up over a length of travel"
    length: Scalar = quantity(0.031, "m", "assumed: contact length r (theta_1 - theta_2) of Table 1", 1e-4, 1.0, "L")
    damping: Scalar = quantity(0.1, "s", "assumed: the start on the flat hardly rings", 0.0, 10.0, "T")
    states: ClassVar[tuple[State, ...]] = (State("S", odd=True), State("S_y", odd=True))

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Set S and S_y from the states and their rates."""
        S, S_y = (state + self.damping * rate for state, rate in zip(x, self.rate(contact, Load(), x), strict=True))
        return contact._replace(S=ca.fmin(1.0, ca.fmax(-1.0, S)), S_y=S_y)

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return ds/dt and ds_y/dt."""
        rolling = ca.fmax(ca.fabs(contact.rim), ca.fabs(contact.v_x))
        along = (contact.rim - contact.v_x - rolling * x[0]) / self.length
        return along, (contact.v_y - sliding_speed(contact) * x[1]) / self.length


def sliding_speed(contact: Contact) -> Scalar:
    """Return the speed at which fresh soil comes under the wheel [m/s]."""
    rolling = ca.fmax(ca.fabs(contact.rim), ca.fabs(contact.v_x))
    return ca.fmax(rolling, SIDEWAYS_SHARE * ca.fabs(contact.v_y))
