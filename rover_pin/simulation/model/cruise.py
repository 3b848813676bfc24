"""The slip at which a rover cruises on level ground, and the motion resistance that follows from this slip."""

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.wheel_forces import load_traction_factor, wheel_forces

CRUISE_SLIP = 0.05
"""Slip of a rover that drives steadily on level ground [-] (assumed). The paper states only that the slip "stays near
0"."""
CRUISE_SPEED, CRUISE_DUTY = 0.05, 0.55
"""Steady speed of the paper's test bed [m/s], and the duty [-] that gives this speed. Source: the paper, section 5."""


def default_resistance(
    soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH, S: float = CRUISE_SLIP
) -> float:
    """Return the motion resistance R [-] of the soil under a rover's wheels, for models that declare none. R is chosen
    such that the rover cruises on level ground at the slip S.

    On level ground a wheel turns steadily if its pull equals its resistance, F(S) f_n = R f_n, where f_n is the wheel
    load, F the traction factor (pull divided by load) and S the slip. F rises with S from F(0) > 0, because the soil is
    sheared even at zero slip. With R < F(0), driven wheels would therefore skid at S < 0. With R = F(0.05), they drive
    at S = 0.05 on every soil. The traction form `net` already contains the compaction resistance, so its R is 0.

    Parameters
    ----------
    soil, rover, traction : Soil, Rover, SoilTraction
        `traction` states the traction form and the contact angles. F is the mean over all wheels. Each wheel carries an
        equal share of the weight.
    gravity : float
        Gravity [m/s^2], for the wheels' load. With fixed angles F does not depend on the load.
    S : float
        Slip on level ground [-].

    Source: assumed. The paper has no such term, and states that the slip stays near 0 on the flat.
    """
    return 0.0 if traction.form.name == "net" else traction_factor(S, soil, rover, traction, gravity)


def traction_factor(S: float, soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH) -> float:
    """Return the traction factor F(S) [-], the pull of the soil on a wheel divided by the wheel's load, at the slip S.
    It is the mean over a rover's wheels. Each wheel carries an equal share of the weight.

    Parameters
    ----------
    S : float
        Slip [-].
    soil, rover, traction : Soil, Rover, SoilTraction
        `traction` states the traction form and the contact angles.
    gravity : float
        Gravity [m/s^2], which decides the load. F depends on the load only if the contact angles follow the sinkage.
    """
    wheels = [mount.wheel for mount in rover.wheels]
    # Wheels with equal dimensions have equal factors, which are computed once.
    load = rover.mass * gravity / len(wheels)
    factors: dict[Wheel, float] = {}
    for wheel in dict.fromkeys(wheels):
        if isinstance(traction.angles, FixedAngles):
            factors[wheel] = float(load_traction_factor(S, soil, wheel, traction.form, traction.angles))
        else:
            # These angles follow from the sinkage, at which Eq (6) carries the load.
            theta_1 = entry_angle(load, S, wheel, soil)
            forces = wheel_forces(S, theta_1, -soil.exit_ratio * theta_1, wheel, soil)
            factors[wheel] = float(traction.form.factor(forces, wheel, S))
    return sum(factors[wheel] for wheel in wheels) / len(wheels)


def level_slip(
    R: float, soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH, least: float = -0.99
) -> float:
    """Return the slip S < 0 [-] at which driven wheels skid on level ground; 0 if they do not skid.

    Wheels skid if the motion resistance R is smaller than the traction factor at zero slip, F(0); the result is the
    slip at which F(S) = R. F is the pull and R the motion resistance, both divided by the wheel load. If F exceeds R at
    all slips from 0 down to `least`, the result is `least`.
    """

    def spare(S: float) -> float:
        """Return the pull minus the motion resistance of a wheel at the slip S, divided by its load."""
        return traction_factor(S, soil, rover, traction, gravity) - R

    if traction.form.name == "net" or spare(0.0) <= 0.0:
        return 0.0
    from scipy.optimize import brentq  # imported late: it loads sparse matrices, which a drive does not need

    # F(S) - R rises with S, so that its zero is the slip at which pull and resistance are equal.
    return float(brentq(spare, least, 0.0)) if spare(least) < 0.0 else least
