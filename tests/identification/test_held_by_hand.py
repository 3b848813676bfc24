"""Ranges of held numbers, how far each moves a free one, and what that is said to be: worked out by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.coordinates import Linear, Log
from rover_pin.identification import dependence
from rover_pin.identification.dependence import _distance, _evaluate_dependence, _refit, with_held
from rover_pin.identification.held import held_numbers
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.parameter_verdict import data_share
from rover_pin.identification.result import Assumed, Estimate, Held, Verdict
from rover_pin.measurements.channel import DrawbarPull
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.soil.traction import load_traction_factor

WHEEL = Wheel(r=0.06, b=0.05)
SAND = Soil(c=100.0, phi=0.55, k=0.008, k_1=6e4, k_2=1e5, n=1.0, theta_2=-0.1)
WIDE = 1.959964
"""SDs of a 95 % interval."""


def rig(rows=6, **how):
    """A wheel that pulls as no law says, so that every row is missed."""
    slip = np.linspace(0.1, 0.8, rows)
    return WheelRig(WHEEL, slip, np.full(rows, 20.0), (DrawbarPull(np.linspace(4.0, 2.0, rows), 0.01),), **how)


def points(**how):
    slip = np.linspace(0.05, 0.8, 8)
    return TractionPoints(slip, [float(load_traction_factor(S, SAND, WHEEL)) for S in slip], 0.003, **how)


def row(name, data, free=("phi",), said=None):
    return next(one for one in held_numbers(data, SAND, free, said) if one.name == name)


# --- ranges ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "free", "stated", "otherwise"),
    [("k", ("phi",), 0.35, 0.7), ("k_1", ("k_2",), 0.35, 0.7), ("k_2", ("k_1",), 0.35, 0.7)],
)
def test_a_modulus_is_a_factor_off(name, free, stated, otherwise):
    value = float(getattr(SAND, name))
    for how, sd in (({}, otherwise), ({"declared": {name: value}}, stated)):
        found = row(name, rig(**how), free)
        assert (found.low, found.high) == pytest.approx((value * math.exp(-WIDE * sd), value * math.exp(WIDE * sd)))


@pytest.mark.parametrize(
    ("name", "stated", "otherwise"),
    [("theta_1", math.radians(2.0), math.radians(4.0)), ("theta_2", math.radians(2.0), math.radians(4.0)),
     ("exit_ratio", 0.05, 0.1)],
)  # fmt: skip
def test_an_angle_and_a_ratio_are_so_much_off(name, stated, otherwise):
    value = float(getattr(SAND, name))
    for how, sd in (({}, otherwise), ({"declared": {name: value}}, stated)):
        found = row(name, rig(**how))
        assert found.high == pytest.approx(value + WIDE * sd)


@pytest.mark.parametrize("name", ["r", "b"])
def test_undeclared_wheel_size_has_an_sd_of_one_percent(name):
    wheel = Wheel(r=0.06, b=0.04)
    found, value = row(name, points(wheel=wheel)), float(getattr(wheel, name))
    assert (found.low, found.high) == pytest.approx((value * math.exp(-0.01 * WIDE), value * math.exp(0.01 * WIDE)))
    assert found.source == "of the data's wheel"
    assert not found.measured


def test_a_modulus_of_nothing_beside_a_free_one_is_nothing():
    held = held_numbers(rig(), SAND.replace(k_2=0.0), ("k_1",))
    assert next(one for one in held if one.name == "k_2").value == 0.0


def test_the_pressure_is_whose_word_its_moduli_are():
    assert row("k_1 + k_2 b", rig(), said={"k_1": "--set"}).source == "--set"
    both = {"k_1": 6e4, "k_2": 1e5}
    assert not row("k_1 + k_2 b", rig(declared=both)).measured
    stated = row("k_1 + k_2 b", rig(declared=both, doubts={"k_1": 6.5e3}))
    assert stated.measured
    assert stated.high == pytest.approx(6.5e4 * math.exp(0.1 * WIDE))


def test_a_number_was_measured_where_its_range_is_stated():
    assert not row("r", rig()).measured
    assert row("r", rig(wheel_range={"r": (0.059, 0.061)})).measured
    assert row("n", rig(declared={"n": 1.0}, doubts={"n": 0.02})).measured
    assert not row("n", rig(declared={"n": 1.0})).measured


def test_what_one_of_several_sets_has_is_not_every_sets():
    sets = [rig(name="a"), rig(name="b").rows(np.arange(6) < 4)]
    other = dataclasses.replace(sets[1], wheel=Wheel(r=0.06, b=0.07))
    sources = {one.name: one.source for one in held_numbers((sets[0], other), SAND, ("phi",))}
    assert sources["r"] == "declared with the data, every set's alike"
    assert sources["b of a"] == sources["b of b"] == "declared with the data"


# --- how far ---------------------------------------------------------------------------------------------------------

LINE, FACTOR = Linear(2.0, 10.0), Log()
FIT = SimpleNamespace(
    space=SimpleNamespace(
        axes=[SimpleNamespace(name="phi", coordinate=LINE), SimpleNamespace(name="k", coordinate=FACTOR)]
    )
)


def found(name, low, high):
    return Estimate(name, "", 0.0, 0.0, low, high, Verdict.FOUND, "found")


@pytest.mark.parametrize(
    ("ends", "far"),
    [
        ((3.0, 7.0), 2.0),  # up by 4 of 2
        ((0.0, 3.0), 3.0),  # down by 3 of 1
        ((3.4, 3.2), 0.2),
        ((2.8, 3.1), 0.2),
        ((2.5, 3.5), 0.5),
        ((math.nan, 3.0), math.inf),
    ],
)
def test_shift_is_relative_to_the_interval_on_its_side(ends, far):
    """A value of 3 in [2, 5], in a coordinate of half of it."""
    assert _distance(FIT, found("phi", 2.0, 5.0), 1.5, ends) == pytest.approx(far)


def test_a_number_of_decades_moves_by_factors():
    """8 in [2, 16]: to 64 is three times as far as its end, to 1 one and a half."""
    one = found("k", 2.0, 16.0)
    assert _distance(FIT, one, math.log(8.0), (8.0, 64.0)) == pytest.approx(3.0)
    assert _distance(FIT, one, math.log(8.0), (1.0, 8.0)) == pytest.approx(1.5)


def held(name):
    return Held(name, "", 1.0, "made", 0.9, 1.1, "made")


@pytest.mark.parametrize(("end", "together"), [(5.1, False), (4.9, True)])
def test_what_one_number_does_alone_is_not_said_of_several(end, together):
    """n moves phi to 5.1 of [2, 5] by itself; to 4.9 only with what c does beside it."""
    rows = [Assumed(held("n"), {"phi": (3.0, end)}), Assumed(held("c"), {"phi": (3.0, 4.4)})]
    told = _evaluate_dependence(FIT, found("phi", 2.0, 5.0), 1.5, rows)
    assert told.verdict is Verdict.DEPENDS
    assert told.depends_on == (("n", "c") if together else ("n",))
    assert (" together: " in told.reason) == together
    assert told.verdict_text == f"depends on the assumed {'n and c' if together else 'n'}"


# --- what enters -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("change", "enters"), [(0.0, False), (5e-10, False), (2e-9, True), (5.0, True)])
def test_tiny_prediction_change_counts_however_far_off(change, enters, monkeypatch):
    before, after = (
        SimpleNamespace(evaluate=lambda u, to=to: (np.full(3, to), None)) for to in (100.0, 100.0 + change)
    )
    monkeypatch.setattr(dependence, "_changed", lambda sets, fit, change: after)
    monkeypatch.setattr(dependence, "descend", lambda problem, u: (u + 1.0,))
    u = _refit([], before, {"n": 1.1}, np.array([2.0]))
    assert u is None if not enters else u == pytest.approx([3.0])


def test_data_with_more_rows_after_recomputing_are_refitted():
    data, more = rig(), rig(9)
    first = identify(data, SAND, ("phi",), search=Search(starts=1))
    moved = Held("settle", "s", 1.0, "made", 0.5, 2.0, "made", (lambda: more, lambda: data))
    rows = with_held(first, data, [moved]).fixed[0].refitted["phi"]
    fresh = identify(more, SAND, ("phi",), search=Search(starts=1))["phi"].value
    assert rows == pytest.approx((fresh, first["phi"].value), rel=1e-4)


# --- what is said ----------------------------------------------------------------------------------------------------


def test_a_report_has_its_heading_where_anything_is_held():
    first, heading = (
        identify(rig(), SAND, ("phi",), search=Search(starts=1)),
        "held, each with its source and 95 % range",
    )
    assert heading not in first.report()
    assert with_held(first, rig(), held_numbers(rig(), SAND, ("phi",))).report().count(heading) == 1


def test_zero_modulus_may_be_all_pressure_under_two_widths():
    """k_2 = 0 of k_1 + k_2 b: none of it, or as much as k_1 is now."""
    wide = dataclasses.replace(rig(), wheel=WHEEL.replace(b=0.1), name="wide")
    sand = SAND.replace(k_2=0.0)
    k_2 = next(one for one in held_numbers((rig(name="narrow"), wide), sand, ("phi",)) if one.name == "k_2")
    assert (k_2.value, k_2.low) == (0.0, 0.0)
    assert k_2.high == pytest.approx(SAND.k_1 / 0.05)
    assert k_2.ends == ({}, {"k_2": k_2.high, "k_1": 0.0})


@pytest.mark.parametrize(("sd", "share"), [(0.2, 1.0), (0.1, 1.0), (0.4, 0.25)])
def test_data_share_is_of_the_variance_from_the_data_alone(sd, share):
    """The column (3, 4, 7) beside (0, 0, 2) of a number without a prior: 5 are its own, and so an SD of 1 / 5."""
    jacobian = np.array([[3.0, 0.0, 9.0], [4.0, 0.0, 9.0], [7.0, 2.0, 9.0]])
    problem = SimpleNamespace(
        data_jacobian=lambda u: jacobian, space=SimpleNamespace(names=("phi", "k", "R")), priors={"R": 1.0}
    )
    best = SimpleNamespace(u=None, covariance=np.diag([sd**2, 1.0, 1.0]))
    assert data_share(problem, best, 0) == pytest.approx(share)
