"""Traction points with errors in both axes and shared errors: against generalised least squares written plainly."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Soil, Wheel
from rover_pin.identification.identify import Search, identify
from rover_pin.measurements.channel import FIELDS
from rover_pin.measurements.traction_points import TractionPoints, read_traction_points
from rover_pin.soil.traction import NetTraction, load_traction_factor

SLIPS = np.linspace(0.02, 0.9, 12)
SOIL, WHEEL = Soil(k=0.008), Wheel()
VALUES = np.array([float({**WHEEL.values(), **SOIL.values()}[name]) for name in FIELDS])


def curve(S, soil=SOIL):
    return np.array([float(load_traction_factor(float(s), soil, WHEEL, NetTraction())) for s in S])


def points(**errors):
    bent = curve(SLIPS) + 0.01 * np.cos(7.0 * SLIPS)
    return TractionPoints(SLIPS, bent, 0.006 + 0.004 * SLIPS, **errors)


ERRORS = {"slip_sd": 0.02, "shared": 0.03 * SLIPS, "slip_shared": 0.015}


def test_chi2_is_that_of_generalised_least_squares():
    """r^T C^-1 r with C = diag(b^2 + F'^2 a^2) + e e^T + F' e_S (F' e_S)^T, F' by differences."""
    made = points(**ERRORS)
    predicted, _ = made.predictor(("k", "phi"))(VALUES)
    w = (predicted - made.factor) / made.sd
    F, slope = curve(SLIPS), (curve(SLIPS + 1e-5) - curve(SLIPS - 1e-5)) / 2e-5
    e, e_S = made.shared, slope * made.slip_shared
    C = np.diag(made.sd**2 + (slope * made.slip_sd) ** 2) + np.outer(e, e) + np.outer(e_S, e_S)
    assert w @ w == pytest.approx((F - made.factor) @ np.linalg.solve(C, F - made.factor), rel=1e-6)


@pytest.mark.parametrize(
    "errors", [{}, {"slip_sd": 0.02}, {"shared": 0.01}, ERRORS], ids=["none", "slip", "all", "each"]
)
def test_the_jacobian_is_the_derivative(errors):
    predict = points(**errors).predictor(("k", "phi"))
    _, jacobian = predict(VALUES)
    for column, name in enumerate(("k", "phi")):
        step = np.zeros(len(VALUES))
        step[FIELDS.index(name)] = 1e-5 * VALUES[FIELDS.index(name)]
        central = (predict(VALUES + step)[0] - predict(VALUES - step)[0]) / (2.0 * step.sum())
        assert jacobian[:, column] == pytest.approx(central, rel=1e-4, abs=1e-6 * np.max(np.abs(central)))


def test_without_errors_of_the_slip_the_prediction_is_the_factor():
    predicted, _ = points().predictor(("k",))(VALUES)
    assert predicted == pytest.approx(curve(SLIPS), rel=1e-9)


def test_a_noisy_slip_does_not_flatten_the_curve():
    """Slips off by 0.04 (1 SD) on the steep part: taken as exact, the fit says two thirds of the true k."""
    slips, random = np.tile(np.linspace(0.0, 0.3, 8), 6), np.random.default_rng(5)
    told = {0.04: [], 0.0: []}
    for _ in range(12):
        slip = slips + 0.04 * random.standard_normal(48)
        factor = curve(slips) + 0.005 * random.standard_normal(48)
        for sd, found in told.items():
            fit = identify(TractionPoints(slip, factor, 0.005, slip_sd=sd), SOIL, search=Search(starts=1))
            found.append(math.log(fit.soil.k / SOIL.k))
    right, wrong = (np.mean(found) for found in told.values())
    assert abs(right) < 2.0 * np.std(told[0.04]) / math.sqrt(12)
    assert wrong < -0.3


def test_a_shared_error_widens_phi_more_than_k():
    """Thrust goes with tan phi: a factor on all F is mostly a change of phi."""
    plain, wide = (identify(points(shared=each), SOIL, search=Search(starts=1)) for each in (0.0, 0.05 * curve(SLIPS)))
    assert wide["phi"].sd > 1.5 * plain["phi"].sd
    assert wide["k"].sd / plain["k"].sd < 0.9 * wide["phi"].sd / plain["phi"].sd


def test_errors_are_checked(tmp_path):
    with pytest.raises(DataError, match=r"slip_sd is negative in row 1 \(-0.1\); slip_sd must be 0 or more"):
        points(slip_sd=-0.1)
    with pytest.raises(DataError, match="different lengths"):
        points(shared=[0.1, 0.2])
    file = tmp_path / "points.csv"
    file.write_text("slip,traction_factor,sd,slip_sd\n0.1,0.1,0.01,0.02\n0.4,0.2,0.01,0.03\n")
    assert read_traction_points(file).slip_sd == pytest.approx([0.02, 0.03])
