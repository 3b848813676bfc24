"""Identification: exact Jacobians, known truths, coverage of the intervals, verdicts, refusals and failures."""

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from rover_pin.base.errors import DataError, OptimisationError, ParameterError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation import descent
from rover_pin.estimation.descent import descend
from rover_pin.estimation.problem import Prior
from rover_pin.identification.identify import Search, build, identify, profile
from rover_pin.identification.result import Verdict
from rover_pin.measurements.channel import FIELDS, DrawbarPull, Sinkage, Torque
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.traction import GrossTraction, TorqueTraction, load_traction_factor, wheel_forces

DATA = Path(__file__).parents[2] / "studies" / "data"
WHEEL, SLIPS, NOISE = Wheel(), np.linspace(0, 1, 11), 0.03
SHORT = Soil(k=0.005)
SAND = Soil(k=0.008, phi=0.55, n=1.1, c=400.0, k_1=8e4)
RIG_SD = (0.1, 0.003, 0.0005)
ALL = ("k", "phi", "c", "n", "k_1")


def factors(soil, slips=SLIPS):
    return np.array([load_traction_factor(float(S), soil, WHEEL) for S in slips])


def points(soil=SHORT, rng=None):
    noise = rng.normal(0, NOISE, len(SLIPS)) if rng else 0.0
    return TractionPoints(SLIPS, factors(soil) + noise, NOISE)


def measured(soil, wheel, slip, load):
    """Channels of a rig from the soil's own float functions, point by point: no compiled prediction involved."""
    rows = []
    for S, W in zip(slip, load, strict=True):
        theta_1 = entry_angle(float(W), float(S), wheel, soil)
        forces = wheel_forces(float(S), theta_1, -soil.exit_ratio * theta_1, wheel, soil)
        rows.append((forces.f_t, forces.torque, sinkage(theta_1, wheel)))
    return np.array(rows).T


def rig(soil=SAND, loads=(5.0, 9.5, 15.0), wheel=WHEEL, rng=None):
    level = np.array([0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8])
    slip, load = np.tile(level, len(loads)), np.repeat(loads, len(level))
    values = measured(soil, wheel, slip, load)
    if rng:
        values = values + rng.normal(size=values.shape) * np.array(RIG_SD)[:, None]
    kinds = zip((DrawbarPull, Torque, Sinkage), values, RIG_SD, strict=True)
    return WheelRig(wheel, slip, load, tuple(kind(value, sd) for kind, value, sd in kinds))


def fields(soil, wheel=WHEEL):
    named = {**wheel.values(), **soil.values()}
    return np.array([named[name] for name in FIELDS])


# --- predictions -----------------------------------------------------------------------------------------------------


def test_rig_prediction_equals_the_soils_float_functions():
    data = rig()
    predicted, _ = data.predictor(("k",))(fields(SAND))
    np.testing.assert_allclose(predicted, np.concatenate([channel.measured for channel in data.channels]), rtol=1e-12)


@pytest.mark.parametrize("form", [None, TorqueTraction(), GrossTraction()])
def test_factor_prediction_equals_the_soils_float_functions(form):
    chosen = {} if form is None else {"form": form, "angles": SinkageAngles()}
    data = TractionPoints(SLIPS, SLIPS, 1.0, **chosen)
    expected = [load_traction_factor(float(S), SAND, WHEEL, **chosen) for S in SLIPS]
    np.testing.assert_allclose(data.predictor(("k",))(fields(SAND))[0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("data", "free"),
    [(rig(), (*ALL, "exit_ratio", "r", "b", "k_2")), (points(), ("k", "phi", "n", "theta_1", "theta_2"))],
)
def test_jacobian_equals_central_differences(data, free):
    predict, at = data.predictor(free), fields(SAND)
    jacobian = predict(at)[1].copy()
    for column, name in enumerate(free):
        index = FIELDS.index(name)
        step = np.zeros(len(FIELDS))
        step[index] = 1e-5 * (abs(at[index]) or 1e6)
        slope = (predict(at + step)[0].copy() - predict(at - step)[0]) / (2 * step[index])
        np.testing.assert_allclose(jacobian[:, column], slope, atol=1e-6 * np.abs(slope).max(), err_msg=name)


def test_own_wheel_is_used_unless_it_is_free():
    wheel = Wheel(0.06, 0.04)
    data = rig(wheel=wheel)
    predicted, _ = data.predictor(("k",))(fields(SAND, WHEEL))
    np.testing.assert_allclose(predicted, np.concatenate([channel.measured for channel in data.channels]), rtol=1e-12)


# --- known truths ----------------------------------------------------------------------------------------------------


def test_noiseless_rig_returns_the_soil():
    result = identify(rig(), Soil(n=0.9, c=100.0, k=0.01), ALL)
    for name in ALL:
        assert result[name].value == pytest.approx(getattr(SAND, name), rel=1e-4), name
    assert result.identified == ALL
    assert result.chi2 < 1e-6
    assert result.starts.agreed == result.starts.tried == 5
    assert result.soil.n == result["n"].value


def test_noiseless_points_return_k_and_phi_from_table_1s_start():
    result = identify(points(), Soil())
    assert result["k"].value == pytest.approx(0.005, rel=1e-4)
    assert result["phi"].value == pytest.approx(math.radians(30), rel=1e-4)


def test_two_wheels_part_k_1_from_k_2():
    soil = SAND.replace(k_1=2e4, k_2=1.2e6)
    wheels = [Wheel(0.045, 0.05), Wheel(0.08, 0.12)]
    result = identify([rig(soil, wheel=wheel) for wheel in wheels], soil.replace(k_1=5e4, k_2=5e5), ("k", "k_1", "k_2"))
    assert result["k_1"].value == pytest.approx(2e4, rel=1e-3)
    assert result["k_2"].value == pytest.approx(1.2e6, rel=1e-4)


def test_local_deviations_equal_the_notes_of_a_plain_covariance():
    """SD = (J^T J)^-1 by central differences of the plain float functions, sharing no compiled code."""
    jacobian = []
    for change in ({"k": 1e-5}, {"phi": 1e-5}):
        ((name, h),) = change.items()
        up, down = (SHORT.replace(**{name: getattr(SHORT, name) + side * h}) for side in (1, -1))
        jacobian.append((factors(up) - factors(down)) / (2 * h) / NOISE)
    sd = np.sqrt(np.diag(np.linalg.inv(np.array(jacobian) @ np.array(jacobian).T)))
    result = identify(points(), Soil())
    assert [result["k"].sd, result["phi"].sd] == pytest.approx(sd.tolist(), rel=1e-4)
    assert result["k"].sd / 0.005 == pytest.approx(0.14, abs=0.01)
    assert math.degrees(result["phi"].sd) == pytest.approx(1.1, abs=0.1)


def test_own_descent_agrees_with_scipy():
    problem = build(rig(rng=np.random.default_rng(7)), Soil(n=0.9, c=100.0, k=0.01), ALL, {})
    bounds = (problem.space.low, problem.space.high)
    found = least_squares(
        lambda u: problem.evaluate(u)[0], problem.space.start(), bounds=bounds, xtol=1e-12, ftol=1e-12
    )
    u, chi2 = descend(problem, problem.space.start())
    assert chi2 == pytest.approx(2 * found.cost, abs=1e-4)
    sd = np.sqrt(np.diag(np.linalg.inv(problem.evaluate(u)[1].T @ problem.evaluate(u)[1])))
    np.testing.assert_array_less(np.abs(u - found.x), 0.02 * sd)


def test_same_input_gives_the_same_result():
    data = rig(rng=np.random.default_rng(2))
    assert identify(data, Soil(), ALL).estimates == identify(data, Soil(), ALL).estimates


# --- intervals -------------------------------------------------------------------------------------------------------


def coverage(simulate, truth, start, free, fits):
    held = np.zeros(len(free))
    for seed in range(fits):
        result = identify(simulate(np.random.default_rng(seed)), start, free, search=Search(starts=1))
        held += [estimate.low <= getattr(truth, estimate.name) <= estimate.high for estimate in result.estimates]
    return held / fits


def test_stated_95_percent_intervals_hold_the_truth_points():
    """240 fits: 95 % +- 1.4 % (1 SD); the issue asks for 90 to 99 %."""
    share = coverage(lambda rng: points(SHORT, rng), SHORT, Soil(), ("k", "phi"), 240)
    assert ((share >= 0.90) & (share <= 0.99)).all(), share


@pytest.mark.slow
def test_stated_95_percent_intervals_hold_the_truth_rig():
    share = coverage(lambda rng: rig(rng=rng), SAND, Soil(n=0.9, c=100.0, k=0.01), ALL, 300)
    assert ((share >= 0.90) & (share <= 0.99)).all(), share


@pytest.mark.slow
def test_intervals_cover_the_truth_if_k_and_phi_are_confounded():
    """At Table 1's k = 0.05 m the intervals are open or very wide, and still hold the truth."""
    share = coverage(lambda rng: points(Soil(), rng), Soil(), Soil(), ("k", "phi"), 300)
    assert ((share >= 0.90) & (share <= 0.995)).all(), share


def test_an_interval_end_raises_the_profile_by_its_quantile():
    data = points(SHORT, np.random.default_rng(5))
    result = identify(data, Soil())
    ends = profile(data, Soil(), ("k", "phi"), "k", np.array([result["k"].low, result["k"].value, result["k"].high]))
    assert ends - result.chi2 == pytest.approx([3.84, 0.0, 3.84], abs=0.05)


def test_profile_falls_to_the_fit_and_rises_on_both_sides():
    data = points(SHORT, np.random.default_rng(5))
    best = identify(data, Soil())
    chi2 = profile(data, Soil(), ("k", "phi"), "phi", best["phi"].value + np.radians(np.arange(-4, 5)))
    assert all(a > b for a, b in pairwise(chi2[:5]))
    assert all(a < b for a, b in pairwise(chi2[4:]))
    assert chi2.min() == pytest.approx(best.chi2, abs=1e-3)


def test_understated_noise_widens_the_intervals_and_says_so():
    rng = np.random.default_rng(1)
    factor = factors(SHORT) + rng.normal(0, NOISE, len(SLIPS))
    honest = identify(TractionPoints(SLIPS, factor, NOISE), Soil())
    bold = identify(TractionPoints(SLIPS, factor, NOISE / 10), Soil())
    assert honest.misfit == 1
    assert bold.misfit > 3
    assert bold["k"].sd == pytest.approx(honest["k"].sd * bold.misfit / 10, rel=0.01)
    assert "misses the data by more than their noise" in bold.report()


# --- what the data cannot tell ---------------------------------------------------------------------------------------


def test_table_1_shows_only_tan_phi_over_k():
    result = identify(points(Soil()), Soil())
    assert abs(result.correlation[0, 1]) > 0.998
    assert math.degrees(result["phi"].sd) == pytest.approx(39, rel=0.05)
    assert result["k"].sd / 0.05 == pytest.approx(1.9, rel=0.05)
    assert result.identified == ()
    assert math.isnan(result["k"].value)
    assert result["phi"].high == pytest.approx(quantities(Soil)["phi"].high)
    assert "correlation of k and phi: 0.99" in result.report()
    assert "not identifiable from traction factor" in result["phi"].reason


def test_n_is_refused_from_the_traction_factor_alone():
    said = (
        r"n is not identifiable from the traction factor F\(S\) alone, which tells k, phi only: sinkage under two loads"
    )
    with pytest.raises(ParameterError, match=said):
        identify(points(), Soil(), ("k", "phi", "n"))


def test_n_with_a_prior_is_held_at_it():
    result = identify(points(), Soil(), ("k", "phi", "n"), {"n": Prior(1.0, 0.1)})
    assert result["n"].verdict is Verdict.HELD_AT_PRIOR
    assert result["n"].value == pytest.approx(1.0, abs=0.01)
    assert result["n"].sd == pytest.approx(0.1, rel=0.02)
    assert "held at prior: traction factor give" in result["n"].reason
    assert result["phi"].reason == "found, given the prior of n"


def test_a_parameter_that_only_anothers_prior_tells_is_not_found():
    """On Table 1's soil k and phi trade for each other: where phi is given, k follows, and that is no finding."""
    result = identify(points(Soil()), Soil(), ("k", "phi"), {"phi": Prior(math.radians(30.0), math.radians(3.0))})
    assert result["k"].verdict is Verdict.HELD_AT_PRIOR
    assert re.match(r"set by the prior of phi: its interval would be \d+% as wide were phi exact", result["k"].reason)


def test_c_and_phi_need_three_loads_and_are_refused_from_one():
    one = rig(loads=(9.5, 9.7))
    with pytest.raises(
        ParameterError, match=r"c and phi are not identifiable together from one load \(all runs carry abo"
    ):
        identify(one, SAND, ALL)
    result = identify(one, SAND, ALL, {"c": Prior(400.0, 100.0)})
    assert result["c"].verdict is Verdict.HELD_AT_PRIOR
    assert {"c", "phi"} <= set(identify(rig(), SAND, ALL).identified)


def test_one_load_cannot_tell_c_by_its_own_numbers_either():
    """The rule's reason, measured: with c free at one load, the SD of phi is tens of times that at three loads."""
    free = ("phi", "c")
    sd = []
    for loads in ((9.5,), (5.0, 9.5, 15.0)):
        problem = build(rig(loads=loads).only(DrawbarPull), SAND, free, {})
        jacobian = problem.evaluate(problem.space.start())[1]
        sd.append(np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))[0])
    assert sd[0] > 5 * sd[1]


def test_k_1_and_k_2_are_refused_from_one_width():
    with pytest.raises(
        ParameterError, match=r"k_1 and k_2 are not identifiable together from one wheel width \(0.05 m\)"
    ):
        identify(rig(), SAND, ("k_1", "k_2"))


def test_fixed_angles_are_refused_from_a_rig():
    with pytest.raises(ParameterError, match=r"theta_1 is not identifiable from a wheel rig.* a sinkage measurement"):
        identify(rig(), SAND, ("k", "theta_1"))


def test_a_parameter_without_influence_is_refused():
    still = rig().rows(slice(0, 1)).only(Sinkage)
    nothing = WheelRig(WHEEL, still.slip, still.load, (Sinkage(still.channels[0].measured, 1e6),))
    with pytest.raises(
        ParameterError, match=r"k is not identifiable: it moves nothing in sinkage; a direct shear test"
    ):
        identify(nothing, SAND, ("k",))


def test_a_parameter_that_others_reproduce_is_refused():
    """One sinkage at one load and slip cannot tell k_1 from n; two points at the same settings are no help."""
    same = rig(loads=(9.5,)).rows([0, 0, 0]).only(Sinkage)
    with pytest.raises(ParameterError, match="not identifiable from sinkage: other free parameters do the same"):
        identify(same, SAND, ("k_1", "n"))


def test_a_bound_that_the_data_do_not_leave_is_not_found():
    result = identify(rig(SAND.replace(c=0.0)), SAND, ALL)
    assert result["c"].verdict is Verdict.NOT_IDENTIFIABLE
    assert result["c"].low == 0.0
    assert result["c"].high < 400.0
    assert "open at its lower bound" in result["c"].reason


# --- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("free", "priors", "error", "said"),
    [
        (("k", "phj"), {}, ParameterError, "no parameter 'phj' can be free: did you mean 'phi'"),
        ((), {}, ParameterError, "must name one parameter or more, each once"),
        (("k", "k"), {}, ParameterError, "must name one parameter or more, each once"),
        (("k",), {"phi": Prior(0.5, 0.1)}, ParameterError, "prior of 'phi' has no free parameter"),
    ],
)
def test_bad_requests(free, priors, error, said):
    with pytest.raises(error, match=said):
        identify(points(), Soil(), free, priors)


def test_more_parameters_than_data():
    few = TractionPoints([0.2], [0.1], 0.03)
    with pytest.raises(
        DataError, match="2 free parameters without a prior and 1 measured values: more parameters than"
    ):
        identify(few, Soil())
    assert identify(few, SHORT, priors={"phi": Prior(0.52, 0.02)})["phi"].verdict is Verdict.HELD_AT_PRIOR


def test_no_data():
    with pytest.raises(DataError, match="there are no data to identify from"):
        identify([], Soil())


@pytest.mark.parametrize(("mean", "sd"), [(0.5, 0.0), (0.5, -1.0), (math.nan, 1.0)])
def test_bad_priors(mean, sd):
    with pytest.raises(ParameterError, match="needs a finite mean and a positive sd"):
        Prior(mean, sd)


def test_wheels_that_differ_cannot_be_freed():
    with pytest.raises(ParameterError, match="r and b cannot be free for data of different wheels"):
        identify([rig(), rig(wheel=Wheel(0.06, 0.06))], SAND, ("k", "r"))


def test_a_soil_that_carries_nothing_cannot_start_a_fit():
    with pytest.raises(ParameterError, match=r"k_1 \+ k_2 b = -10 Pa must be positive to fit k_1"):
        identify(rig(), Soil(k_1=-10.0, k_2=0.0), ("k_1",))


def test_starts_must_be_one_or_more():
    with pytest.raises(ParameterError, match="starts = 0 is not allowed"):
        identify(points(), Soil(), search=Search(starts=0))


def test_a_failed_solver_keeps_its_status(monkeypatch):
    monkeypatch.setattr(descent, "STEPS", 1)
    with pytest.raises(OptimisationError, match="none of 2 starts converged") as caught:
        identify(points(SHORT, np.random.default_rng(0)), Soil(), search=Search(starts=2))
    assert len(caught.value.status) == 2
    assert "did not settle in 1 steps" in caught.value.status[0]


def test_names_of_a_result_are_checked():
    result = identify(points(), Soil())
    with pytest.raises(ParameterError, match="'ph' was not free: did you mean 'phi'"):
        result["ph"]


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("n", 1.0, "profile of 'n' needs it among"), ("k", 20.0, r"profile of k leaves \[1e-05, 0.5\] m")],
)
def test_bad_profiles(name, value, said):
    with pytest.raises(ParameterError, match=said):
        profile(points(), Soil(), ("k", "phi"), name, np.array([value]))


# --- measured data ---------------------------------------------------------------------------------------------------


def test_smooth_wheel_of_the_shipped_data():
    """Load-balanced theta_1, c = 0, n held at 1.46 of pressing the wheel in; the misfit is the sinkage's."""
    result = identify(read_wheel_rig(DATA / "cmu-smooth-wheel"), Soil(c=0.0, k=0.005, n=1.46), ("k", "phi", "k_1"))
    pull, sunk = result.channels
    assert pull.rmse / 24.8 == pytest.approx(0.0141, abs=0.001)
    assert sunk.rmse == pytest.approx(0.0045, abs=0.0001)
    assert result.identified == ("phi", "k_1")
    assert 12 < math.degrees(result["phi"].low) < math.degrees(result["phi"].high) < 20
    assert result["k"].verdict is Verdict.NOT_IDENTIFIABLE
    assert result.misfit > 5
    assert "if what the model misses does not move it" in result["phi"].reason


def test_uncertain_wheel_is_held_at_its_stated_range():
    data = read_wheel_rig(DATA / "cmu-smooth-wheel")
    priors = {
        name: Prior((low + high) / 2, (high - low) / math.sqrt(12)) for name, (low, high) in data.wheel_range.items()
    }
    result = identify(data, Soil(c=0.0, k=0.005, n=1.46), ("k", "phi", "k_1", "r", "b"), priors)
    assert result["b"].verdict is Verdict.HELD_AT_PRIOR
