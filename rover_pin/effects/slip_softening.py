"""A wheel that slips or goes sideways loosens the sand under it: the stiffness falls, by one amount at most."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import SMOOTHING, Contact, Load, Scalar, Soil, right_angle
from rover_pin.effects.effect import Effect, State
from rover_pin.effects.slip_sinkage import rut_cost
from rover_pin.soil.slip import drift, positive_part

WHOLE_DRIFT = 0.4
"""Sine of the slip angle from which drift has loosened 63 % of what it can."""
TURNING_SHARE = 0.02
"""Share of the rim's way that loosens sand where the wheel stands; the measured transients up to S = 0.9 show none."""


@dataclass(frozen=True)
class SlipSoftening(Effect):
    """k_1, k_2 <- exp(-a x) (k_1, k_2); L dx/dt = V (z - x) + 0.02 |r omega| max(z - x, 0), z = sqrt(z_S^2 + z_y^2).

    z_S = S (2 - S) for S > 0 (0 for S < 0, see `Ploughing`): dz/dS = 2 (1 - S), since the rim can loosen no more sand
    than comes in fresh, a share 1 - S of its way. z_y = 1 - exp(-(d / 0.4)^2), d = `slip.drift`, about the sine of the
    slip angle: sideways motion loosens as much as slip can, a, and at 45 deg nearly all of it. What is loose is not
    loosened again, so that slip, drift and skid add as the sides of a right angle (`loosen`).
    Sinkage grows as exp(a x / (n + 1/2)) at any h / b, where a growing exponent (`SlipSinkage`) ends at h = b. x
    follows z over the length L of a contact: digging that goes on at constant slip. It costs the deeper rut by
    `rut_cost`, and the rise of a wheel whose slip falls, f_t = -f_n h a max(x - z, 0) / ((n + 1/2) L).
    Not covered: a wheel dragged along its axle without rolling, which stands twice as deep.
    Source: z_S a fitted form, compared in studies/wheel_laws.py; z_y and the right angle derived here, new, from seven
    measured sets of one sand; L from the transients of studies/close_the_loop.py. Differs from the paper: it holds k_1
    and k_2, and says that digging is not modelled.
    """

    title: ClassVar[str] = "slip-softening"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a slipping wheel loosens the sand under it, so it stands deeper"
    a: Scalar = quantity(1.0, "", "0.9 to 1.6 fitted on measured sand (studies/wheel_laws.py)", 0.0, 6.0, "a")
    length: Scalar = quantity(0.066, "m", "measured transients of a 125 mm wheel: 62 to 71 mm", 1e-3, 1.0, "L")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("loosened"),)
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the sand that slip has loosened."""
        return loosen(contact, self.a * x[0])

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance of the deeper rut, and of the way up where the slip falls."""
        up = lift(contact, load, self.a * (x[0] - loosening(contact)), self.length)
        firm = softer(contact, share_of(contact, self.a * x[0]))
        return Load(f_t=-rut_cost(contact, firm) - up * contact.sense(self.v_0))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return ds/dt."""
        return (approach(contact, loosening(contact) - x[0]) / self.length,)


def loosening(contact: Contact) -> Scalar:
    """Return z of driving slip and drift [-]."""
    S, sideways = positive_part(contact.S), drift(contact.S, contact.S_y) / WHOLE_DRIFT
    return right_angle(S * (2.0 - S), -ca.expm1(-sideways * sideways))


def loosen(contact: Contact, log_lost: Scalar) -> Contact:
    """Return the contact on sand that has lost this much of ln stiffness besides what it had lost before."""
    lost = right_angle(log_lost, contact.loosened)
    return contact._replace(soil=softer(contact, contact.loosened - lost), loosened=lost)


def share_of(contact: Contact, log_lost: Scalar) -> Scalar:
    """Return which part of all lost ln stiffness is due to this one: shares of the sides of a right angle."""
    size = ca.fabs(log_lost)
    return log_lost * size / ca.fmax(contact.loosened, size + SMOOTHING)


def softer(contact: Contact, log_factor: Scalar) -> Soil:
    """Return the soil with its stiffness times exp(log_factor)."""
    factor, soil = ca.exp(log_factor), contact.soil
    return soil.replace(k_1=factor * soil.k_1, k_2=factor * soil.k_2)


def lift(contact: Contact, load: Load, back: Scalar, length: Scalar) -> Scalar:
    """Return f_n dh/dx [N]: what raises a wheel whose ln stiffness grows by `back` over this length [m]."""
    h = ca.fmax(contact.h, 0.0)
    return load.f_n * h * ca.fmax(back, 0.0) / ((contact.soil.n + 0.5) * length)


def approach(contact: Contact, ahead: Scalar) -> Scalar:
    """Return L ds/dt [m/s] of a loosening that is `ahead` of its state: with the travel, and with a rim that digs."""
    return contact.travel * ahead + TURNING_SHARE * ca.fabs(contact.rim) * ca.fmax(ahead, 0.0)
