"""What the paper's text says of Figs 3 and 6, against the three readings of the load-traction factor.

Its words: "By changing S and k, while holding other parameters constant at c = 0.005, phi = 30, theta_1 = 35,
theta_2 = -5 in equations (2)-(7), we obtain Figure 3"; of Fig 6 "the plots show an increasing trend according to the
slip ratio" and it "suggests the traction force exists even at S = 1"; of Fig 8 "the slip ratio switches from 0 to 1 at
the inclination of 12 degrees". n is not given; 1 is assumed, and 0.5 to 2 tried. The figures themselves are not used.
"""

import math

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.wheel_forces import FORMS, load_traction_factor
from tests.oracle import terramechanics as oracle

TABLE_1, WHEEL = Soil(), Wheel()
SLIPS = np.linspace(0, 1, 21)
TWELVE_DEGREES = math.tan(math.radians(12.0))
ALL_FORMS = pytest.mark.parametrize("form", FORMS.values(), ids=lambda form: form.name)


def factor(S, form, **changes):
    return load_traction_factor(float(S), TABLE_1.replace(**changes), WHEEL, form)


def contradicts(form, measured):
    """Return the form of this name, marked as a disagreement with the paper, with the measured value."""
    return pytest.param(FORMS[form], marks=pytest.mark.xfail(strict=True, reason=measured), id=form)


@pytest.mark.parametrize(
    ("form", "at_0", "at_1"), [("net", -0.1642, 0.0012), ("torque", 0.0176, 0.1824), ("gross", 0.0172, 0.1791)]
)
def test_table_1_to_the_letter_gives_these_factors(form, at_0, at_1):
    """The factors are frozen from the sum of the oracle (see the next test), so that the contradiction
    remains visible.
    """
    assert factor(0.0, FORMS[form]) == pytest.approx(at_0, abs=5e-5)
    assert factor(1.0, FORMS[form]) == pytest.approx(at_1, abs=5e-5)


@pytest.mark.parametrize("S", [0.0, 0.1, 1.0])
def test_the_oracle_gives_the_same(S):
    f_n, f_t, torque = oracle.panel_forces(
        S, TABLE_1.theta_1, TABLE_1.theta_2, 0.045, 0.05, 0.005, TABLE_1.phi, 0.05, TABLE_1.k_1, 1.0
    )
    assert factor(S, FORMS["net"]) == pytest.approx(f_t / f_n, abs=1e-7)
    assert factor(S, FORMS["torque"]) == pytest.approx(torque / (0.045 * f_n), abs=1e-7)


@ALL_FORMS
@pytest.mark.parametrize("k", [0.01, 0.025, 0.05, 0.1])
def test_fig_6_increasing_trend_according_to_the_slip_ratio(form, k):
    assert np.all(np.diff([factor(S, form, k=k) for S in SLIPS]) > 0)


@ALL_FORMS
def test_fig_3_is_a_family_over_k(form):
    """A smaller k (a stiffer soil) gives more traction at every slip."""
    family = np.array([[factor(S, form, k=k) for S in SLIPS] for k in (0.01, 0.025, 0.05, 0.1)])
    assert np.all(np.diff(family, axis=0) < 0)


@pytest.mark.parametrize("form", list(FORMS.values()), ids=lambda form: form.name)
def test_fig_6_traction_exists_even_at_s_1(form):
    """This holds for n = 1, for the net form with a small margin only: F(1) = +0.0012."""
    assert factor(1.0, form) > 0


@pytest.mark.parametrize(
    "form", [contradicts("net", "F(0.1) = -0.144, F(0.9) = -0.012"), FORMS["torque"], FORMS["gross"]]
)
def test_rover_travels_stably_at_slip_ratio_around_0(form):
    """Section 5. On level ground this needs a factor that is not negative at a small slip."""
    assert factor(0.1, form) >= 0


@pytest.mark.parametrize(
    "form",
    [
        contradicts("net", "max F = 0.001, 0.1 deg; k = 0.0145 m instead of 0.05 m would give 12.0 deg"),
        contradicts("torque", "max F = 0.182, 10.3 deg"),
        contradicts("gross", "max F = 0.179, 10.2 deg"),
    ],
)
def test_fig_8_grip_is_lost_at_12_degrees(form):
    """Steady climbing needs F >= tan(slope). No form of Table 1 reaches 12 deg; the torque form reaches the largest
    slope.
    """
    assert max(factor(S, form) for S in SLIPS) == pytest.approx(TWELVE_DEGREES, rel=0.05)


@pytest.mark.parametrize("c", [0.0, 0.005, 5.0])
def test_table_1_s_cohesion_has_no_influence(c):
    """0.005 N/m^2 is a thousandth of a percent of the stress. Every c below 5 Pa gives an equal curve."""
    assert factor(0.3, FORMS["torque"], c=c) == pytest.approx(factor(0.3, FORMS["torque"]), abs=2e-4)


@pytest.mark.parametrize(
    "form", [contradicts("net", "F(1) = -0.043 for n = 0.5"), FORMS["torque"], FORMS["gross"]], ids=lambda f: f.name
)
def test_fig_6_traction_exists_even_at_s_1_for_any_missing_n(form):
    assert all(factor(1.0, form, n=n) > 0 for n in (0.5, 1.0, 1.5, 2.0))


def test_net_form_climbs_12_degrees_with_k_other_than_table_1():
    assert factor(1.0, FORMS["net"], k=0.0145) == pytest.approx(TWELVE_DEGREES, rel=0.01)
