"""A wheel that slips or moves sideways loosens the sand under it: the stiffness falls, down to a limit."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import SMOOTHING, Contact, Load, Scalar, Soil, right_angle
from rover_pin.effects.effect import Effect, State
from rover_pin.effects.slip_sinkage import rut_cost
from rover_pin.soil.slip import drift, positive_part

DRIFT_SCALE = 0.4
"""Sine of the slip angle at which sideways motion has reached 63 % of the loosening that it can cause."""
RIM_SHARE = 0.02
"""Fraction of the rim's distance that loosens sand under a wheel that does not travel (assumed). The measured
transients up to S = 0.9 show no such loosening."""


@dataclass(frozen=True)
class SlipSoftening(Effect):
    """A wheel that slips or moves sideways loosens the sand under it, so that the stiffnesses k_1 and k_2 fall, down to
    a limit.

        k_1, k_2 <- exp(-a x) (k_1, k_2),
        L dx/dt = V (z - x) + 0.02 |r omega| max(z - x, 0),   z = sqrt(z_S^2 + z_y^2).

    The state x follows the loosening z over the length L of a contact, at the speed V over the ground. z_S = S (2 - S)
    for S > 0, and 0 for S < 0 (see `Ploughing`). Its slope dz/dS = 2 (1 - S) falls with slip, because the rim can only
    loosen the sand that comes in fresh, a fraction 1 - S of its distance. z_y = 1 - exp(-(d / 0.4)^2), with d =
    `slip.drift`, about the sine of the slip angle: sideways motion loosens sand by up to a, like slip, and by nearly a
    at 45 deg. Loose sand is not loosened again, so that slip, drift and skid add like the sides of a right angle
    (`loosen`).

    The sinkage grows as exp(a x / (n + 1/2)) at any h / b, while a growing exponent (`SlipSinkage`) has no effect at h
    = b. Because x lags behind z, digging goes on at constant slip. The deeper rut costs work (`rut_cost`). The rise of
    a wheel whose slip falls costs f_t = -f_n h a max(x - z, 0) / ((n + 1/2) L). Not covered: a wheel that is dragged
    along its axle without rolling, which sinks twice as deep.

    Source: z_S is a fitted form, compared in studies/wheel_laws.py; z_y and the right angle are derived here, new, from
    seven measured sets of one sand; L comes from the transients of studies/close_the_loop.py. Differs from the paper:
    it holds k_1 and k_2 constant, and states that digging is not modelled.
    """

    title: ClassVar[str] = "slip-softening"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a slipping wheel loosens the sand under it and sinks deeper"
    a: Scalar = quantity(1.0, "", "0.9 to 1.6 fitted on measured sand (studies/wheel_laws.py)", 0.0, 6.0, "a")
    length: Scalar = quantity(0.066, "m", "measured transients of a 125 mm wheel: 62 to 71 mm", 1e-3, 1.0, "L")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("loosened"),)
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with sand that slip and sideways motion have softened."""
        return loosen(contact, self.a * x[0])

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] that the deeper rut costs, and that the rise of a wheel with falling slip
        costs.
        """
        # A positive difference of state and long-run value means that the sand in front is firmer, so that the wheel
        # rises.
        up = lift(contact, load, self.a * (x[0] - loosening(contact)), self.length)
        firm = softer(contact, share_of(contact, self.a * x[0]))
        return Load(f_t=-rut_cost(contact, firm) - up * contact.sense(self.v_0))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative [1/s] of the loosening state."""
        return (approach(contact, loosening(contact) - x[0]) / self.length,)


def loosening(contact: Contact) -> Scalar:
    """Return the loosening [-] that would be reached at constant slip and sideways motion, from 0 for
    untouched sand.
    """
    # Slip and sideways motion add like the sides of a right angle.
    S, sideways = positive_part(contact.S), drift(contact.S, contact.S_y) / DRIFT_SCALE
    return right_angle(S * (2.0 - S), -ca.expm1(-sideways * sideways))


def loosen(contact: Contact, log_lost: Scalar) -> Contact:
    """Return the contact with sand whose stiffness has fallen by the factor exp(-log_lost), in addition to earlier
    losses.

    Losses add like the sides of a right angle (square root of the sum of squares), because loose sand is not loosened
    again.
    """
    # `contact.loosened` is the loss of ln stiffness by the effects before this one.
    lost = right_angle(log_lost, contact.loosened)
    return contact._replace(soil=softer(contact, contact.loosened - lost), loosened=lost)


def share_of(contact: Contact, log_lost: Scalar) -> Scalar:
    """Return the part [-] of one effect, whose own loss is `log_lost`, in the total loss of ln stiffness."""
    size = ca.fabs(log_lost)
    return log_lost * size / ca.fmax(contact.loosened, size + SMOOTHING)


def softer(contact: Contact, log_factor: Scalar) -> Soil:
    """Return the contact's soil with both stiffnesses (k_1 and k_2) multiplied by exp(log_factor)."""
    factor, soil = ca.exp(log_factor), contact.soil
    return soil.replace(k_1=factor * soil.k_1, k_2=factor * soil.k_2)


def lift(contact: Contact, load: Load, back: Scalar, length: Scalar) -> Scalar:
    """Return the resistance [N] of a wheel that is lifted because the soil under it becomes stiffer.

    The logarithm of the stiffness grows by `back` over `length` [m] of travel. The resistance is f_n dh/dx, the work of
    lifting the wheel per metre of travel.
    """
    # h is proportional to stiffness^(-1 / (n + 1/2)) under a given load, which gives dh/dx from the change of ln
    # stiffness.
    h = ca.fmax(contact.h, 0.0)
    return load.f_n * h * ca.fmax(back, 0.0) / ((contact.soil.n + 0.5) * length)


def approach(contact: Contact, ahead: Scalar) -> Scalar:
    """Return the speed [m/s] at which a loosening state follows its long-run value; divided by a length, it is the
    state's time derivative.

    `ahead` is the long-run value minus the state. The state follows with the travel, and also with the rim of a wheel
    that digs in place.
    """
    return contact.travel * ahead + RIM_SHARE * ca.fabs(contact.rim) * ca.fmax(ahead, 0.0)
