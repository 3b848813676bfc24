"""The slip at which a rover cruises level ground, and the motion resistance that goes with it: one default for all."""

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.wheel_forces import load_traction_factor, wheel_forces

CRUISE_SLIP = 0.05
"""Assumed slip on the flat; the paper says that it 'stays near 0'."""
CRUISE_SPEED, CRUISE_DUTY = 0.05, 0.55
"""Paper, section 5: the test bed runs at 0.05 m/s in a steady state when the duty is 0.55."""


def default_resistance(
    soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH, S: float = CRUISE_SLIP
) -> float:
    """Return the motion resistance R [-] of a soil, wheels and their load, where none is declared: R = F(S).

    On level ground a wheel turns steadily where its pull meets its resistance, F(S) f_n = R f_n. F rises with S from
    F(0) > 0, which is what shearing takes at no slip, so R < F(0) would let driven wheels skid at S < 0; with
    R = F(0.05) they drive at S = 0.05 on every soil. F is the mean of the wheels under equal shares of the weight;
    fixed angles do not know the load. The net form holds its own compaction resistance: 0.

    Parameters
    ----------
    soil, rover, traction : Soil, Rover, SoilTraction
        As they are driven: form and angles are those of the traction.
    gravity : float
        [m/s^2], for the wheels' load.
    S : float
        The slip on the flat [-]; 0.05 is assumed.

    Source: assumed. The paper has no such term and says that the slip stays near 0 on the flat.
    """
    return 0.0 if traction.form.name == "net" else traction_factor(S, soil, rover, traction, gravity)


def traction_factor(S: float, soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH) -> float:
    """Return F(S) [-], the mean of the wheels under equal shares of the weight."""
    wheels = [mount.wheel for mount in rover.wheels]
    load = rover.mass * gravity / len(wheels)
    factors = {wheel: _factor_under(load, S, soil, wheel, traction) for wheel in dict.fromkeys(wheels)}
    return sum(factors[wheel] for wheel in wheels) / len(wheels)


def _factor_under(load: float, S: float, soil: Soil, wheel: Wheel, traction: SoilTraction) -> float:
    if isinstance(traction.angles, FixedAngles):
        return float(load_traction_factor(S, soil, wheel, traction.form, traction.angles))
    theta_1 = entry_angle(load, S, wheel, soil)
    forces = wheel_forces(S, theta_1, -soil.exit_ratio * theta_1, wheel, soil)
    return float(traction.form.factor(forces, wheel, S))


def level_slip(
    R: float, soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH, least: float = -0.99
) -> float:
    """Return the slip S [-] at which driven wheels skid on level ground, F(S) = R < F(0); 0 where they do not."""

    def spare(S: float) -> float:
        return traction_factor(S, soil, rover, traction, gravity) - R

    if traction.form.name == "net" or spare(0.0) <= 0.0:
        return 0.0
    from scipy.optimize import brentq  # it brings sparse matrices, which a drive has no use for

    return float(brentq(spare, least, 0.0)) if spare(least) < 0.0 else least
