"""Shear along and across at once: against quadrature by hand, Eq (3) for the resultant, straight running, symmetry."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin import Soil, Wheel, wheel_forces
from rover_pin.soil.combined import combined_forces

WHEEL, SOIL = Wheel(r=0.0625, b=0.06), Soil(k=0.008, phi=0.4, c=50.0, n=1.2, k_1=8e4)
ENTRY, EXIT = 0.8, -0.15


def by_hand(S, sideways):
    """f_n, f_t, f_y, torque and M_z of Eqs (2)-(7), the stress along the displacement, by adaptive quadrature."""
    ratio = 1 - S if S >= 0 else 1 / (1 + S)

    def stresses(at):
        sigma = 8e4 * (0.0625 / 0.06 * (math.cos(at) - math.cos(ENTRY))) ** 1.2
        j_x = 0.0625 * (ENTRY - at - ratio * (math.sin(ENTRY) - math.sin(at)))
        j_y = 0.0625 * sideways * (ENTRY - at)
        j = math.hypot(j_x, j_y)
        tau = (50.0 + sigma * math.tan(0.4)) * (1 - math.exp(-j / 0.008)) / j if j else 0.0
        return sigma, tau * j_x, tau * j_y

    def total(term):
        return 0.0625 * 0.06 * quad(lambda at: term(at, *stresses(at)), EXIT, ENTRY, limit=200)[0]

    f_n = total(lambda at, sigma, x, y: sigma * math.cos(at) + x * math.sin(at))
    f_t = total(lambda at, sigma, x, y: x * math.cos(at) - sigma * math.sin(at))
    f_y, torque = -total(lambda at, sigma, x, y: y), 0.0625 * total(lambda at, sigma, x, y: x)
    return f_n, f_t, f_y, torque, -0.0625 * total(lambda at, sigma, x, y: y * math.sin(at))


@pytest.mark.parametrize("S", [-0.6, -0.2, 0.0, 0.3, 0.9])
@pytest.mark.parametrize("sideways", [0.05, -0.4, 3.0])
def test_forces_are_the_integrals(S, sideways):
    forces = combined_forces(S, sideways, (ENTRY, EXIT), WHEEL, SOIL, 60)
    along = forces.along
    expected = by_hand(S, sideways)
    assert [along.f_n, along.f_t, forces.f_y, along.torque] == pytest.approx(expected[:4], rel=2e-4, abs=2e-3)
    assert forces.moment == pytest.approx(expected[4], rel=2e-4)
    assert forces.moment * forces.f_y > 0.0, "most of the contact is ahead of the axle"


@pytest.mark.parametrize("S", [-0.9, -0.3, 0.0, 0.2, 1.0])
def test_a_wheel_that_runs_straight_is_the_straight_one(S):
    forces = combined_forces(S, 0.0, (ENTRY, EXIT), WHEEL, SOIL)
    assert forces.f_y == 0.0
    assert tuple(forces.along) == pytest.approx(tuple(wheel_forces(S, ENTRY, EXIT, WHEEL, SOIL)), rel=1e-9)


def test_the_resultant_keeps_to_the_strength():
    """int |tau| is at most int c + sigma tan phi; at large displacement it is that."""
    most = (
        0.0625
        * 0.06
        * quad(
            lambda at: 50.0 + math.tan(0.4) * 8e4 * (0.0625 / 0.06 * (math.cos(at) - math.cos(ENTRY))) ** 1.2,
            EXIT,
            ENTRY,
        )[0]
    )
    for S in np.linspace(-0.95, 1.0, 14):
        for y in (0.01, 0.3, 20.0):
            forces = combined_forces(float(S), y, (ENTRY, EXIT), WHEEL, SOIL)
            assert math.hypot(forces.along.torque / 0.0625, forces.f_y) <= most * (1 + 1e-6)
    assert combined_forces(0.0, 1e3, (ENTRY, EXIT), WHEEL, SOIL).f_y == pytest.approx(-most, rel=1e-3)
