"""The verdict on a fitted number, and what is refused before a fit: linear data with a known posterior."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from rover_pin.base.errors import OptimisationError, ParameterError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.coordinates import Axis, Linear, Space
from rover_pin.estimation.covariance import covariance
from rover_pin.estimation.problem import Prior, Problem
from rover_pin.estimation.profile import Best, Interval
from rover_pin.identification import posterior as sampling
from rover_pin.identification.arc_uncertainty import free_unmeasured_modulus
from rover_pin.identification.identifiability import refuse_untold
from rover_pin.identification.identify import (
    Search,
    StartResult,
    _agreement,
    _channel_fits,
    _lowest,
    build,
    misfit,
    profile,
    scatter,
)
from rover_pin.identification.parameter_verdict import judge
from rover_pin.identification.posterior import Chain, Posterior, _walkers, log_density
from rover_pin.identification.result import ChannelFit, Estimate, Identification, Starts, Verdict, _line
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.measurements.wheel_rig import WheelRig

KNOWN = ("k", "phi", "n")
BASE = np.array([0.01, 0.5, 1.0])
WIDEST = 2.0


class Measured:
    """Channels that are X times the numbers, all of which they tell."""

    def __init__(self, X, measured, sd=1.0, loads=(5.0, 15.0), parts=1):
        self.X, self.wheel, self.loads = np.array(X, float), Wheel(), np.array(loads)
        self.tells, self.data_kind = frozenset(quantities(Soil)), "made data"
        rows = zip(np.split(np.array(measured, float), parts), np.split(np.full(len(X), sd), parts), strict=True)
        self.channels = [
            SimpleNamespace(name=f"channel {at}", unit="N", measured=m, sd=s) for at, (m, s) in enumerate(rows)
        ]

    def predictor(self, free):
        columns = [KNOWN.index(name) for name in free]
        return lambda fields: (self.X @ fields, self.X[:, columns])


def problem(X, measured, free=KNOWN, priors=None, scale=1.0, **how):
    about = quantities(Soil)
    axes = tuple(Axis(name, about[name], Linear(scale, WIDEST), -50.0, 50.0) for name in free)
    return Problem([Measured(X, measured, **how)], Space(axes, BASE, KNOWN), priors or {})


def best_of(made):
    u = made.space.start()
    return Best(u, made.chi2(u), covariance(made, u))


CLOSED = Interval(0.49, 0.52, True, True)


def verdict(made, index=1, interval=CLOSED, misfit=1.0):
    return judge(made, best_of(made), index, interval, misfit)


# --- which information counts ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sd", "found"), [(1.02, True), (0.98, False), (0.3, False)])
def test_data_must_give_half_of_what_is_known_beside_a_prior(sd, found):
    """One value of SD 1 and a prior of SD s: the data give s^2 / (1 + s^2) of the information."""
    made = verdict(problem([[0, 1, 0]], [0.5], ("phi",), {"phi": Prior(0.5, sd)}, scale=0.2), 0)
    assert made.verdict is (Verdict.FOUND if found else Verdict.HELD_AT_PRIOR)
    assert made.sd == pytest.approx(sd / math.hypot(1, sd))
    assert made.value == pytest.approx(0.5)
    if not found:
        assert made.reason == f"held at prior: channel 0 give {sd**2 / (1 + sd**2):.0%} of what is known of it"


@pytest.mark.parametrize(("rows", "own"), [([[0, 1, 1]], 1.0), ([[1, 1, 1], [1, 0, 0]], 2.0)])
@pytest.mark.parametrize("times", [0.95, 1.05])
def test_number_set_mostly_by_anothers_prior_is_held(rows, own, times):
    """phi + n, or with k besides, is measured with SD 1: the variance of phi is `own` and that of the prior of n."""
    sd = times * math.sqrt(own)
    free = ("k", "phi", "n") if len(rows) > 1 else ("phi", "n")
    found = verdict(problem(rows, [1.5] * len(rows), free, {"n": Prior(1.0, sd)}), free.index("phi"))
    share = own / (own + sd**2)
    assert found.sd == pytest.approx(math.sqrt(own + sd**2))
    if times < 1:
        assert (found.verdict, found.reason) == (Verdict.FOUND, "found, given the prior of n")
    else:
        assert found.verdict is Verdict.HELD_AT_PRIOR
        assert (
            found.reason == f"set by the prior of n: its interval would be {math.sqrt(share):.0%} as wide were n exact"
        )


@pytest.mark.parametrize(
    ("closed", "why"),
    [((False, True), "lower bound"), ((True, False), "upper bound"), ((False, False), "lower and upper bound")],
)
def test_number_at_its_bound_has_no_value_despite_wide_priors(closed, why):
    """A cart's log with a wrong k said phi = 60 +- 10 deg, "set by the prior of k_1": 60 deg is phi's bound."""
    made = problem([[0, 1, 1]], [1.5], ("phi", "n"), {"n": Prior(1.0, 3.0)})
    found = verdict(made, 0, Interval(0.3, 0.5, *closed))
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert math.isnan(found.value)
    assert f"the 95 % interval is open at its {why}; " in found.reason
    assert verdict(made, 0, Interval(0.3, 0.5, True, True)).verdict is Verdict.HELD_AT_PRIOR


PLAIN = problem(np.eye(3), [0.01, 0.5, 1.0])


@pytest.mark.parametrize(
    ("interval", "why"),
    [
        (Interval(0.3, WIDEST + 0.3 - 1e-6, True, True), ""),
        (Interval(-0.3, WIDEST - 0.3 + 1e-6, True, True), "the 95 % interval is too wide to call it found"),
        (Interval(0.3, 0.5, False, True), "the 95 % interval is open at its lower bound"),
        (Interval(0.3, 0.5, True, False), "the 95 % interval is open at its upper bound"),
        (Interval(0.3, 0.5, False, False), "the 95 % interval is open at its lower and upper bound"),
        (Interval(0.3, 0.5, True, True, (1,)), ""),
        (Interval(0.3, 0.5, True, True, (0, 2)), "the 95 % interval ends where k and n meets its own bound, not"),
        (Interval(0.3, 0.5, True, False, (0,)), "the 95 % interval is open at its upper bound"),
    ],
)
def test_a_number_is_found_where_the_data_end_its_interval(interval, why):
    found = verdict(PLAIN, 1, interval)
    if not why:
        assert (found.verdict, found.value, found.reason) == (Verdict.FOUND, pytest.approx(0.5), "found")
        return
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert math.isnan(found.value)
    assert found.reason.startswith(f"not identifiable from channel 0: {why}")


def test_an_estimate_is_in_the_numbers_own_unit_and_bounds():
    about = quantities(Soil)["phi"]
    found = verdict(problem([[0, 1, 0]], [0.5], ("phi",), scale=0.1), 0, Interval(-30.0, 6.0, True, True))
    assert found.sd == pytest.approx(1.0), "SD of the value, whatever the scale of u"
    assert (found.low, found.high) == (about.low, pytest.approx(0.6))
    assert (
        verdict(problem([[0, 1, 0]], [0.5], ("phi",), scale=0.1), 0, Interval(4.0, 40.0, True, True)).high == about.high
    )


@pytest.mark.parametrize(
    ("widened", "said"), [(1.0, "found"), (1.01, "found, if what the model misses does not move it")]
)
def test_a_model_that_misses_the_data_says_so_of_what_it_finds(widened, said):
    assert verdict(PLAIN, misfit=widened).reason == said


# --- refusals before a fit -------------------------------------------------------------------------------------------


def refused(X, free=("k", "phi"), **how):
    made = problem(X, np.zeros(len(X)), free, **how)
    try:
        refuse_untold(made, [made.space.start()])
    except ParameterError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(("moves", "seen"), [(1.05e-3, True), (-1.05e-3, True), (0.95e-3, False)])
def test_number_that_moves_nothing_measurable_is_refused(moves, seen):
    said = refused([[1, 0, 0], [0, moves, 0], [0, 0, 0]])
    assert said == "" if seen else said.startswith("phi is not identifiable: it moves nothing in channel 0; a direct")


@pytest.mark.parametrize(("own", "seen"), [(1.1e-5, True), (0.9e-5, False)])
def test_a_number_that_others_reproduce_to_1e_5_is_refused(own, seen):
    said = refused([[3.0, 1.0, 0], [0.0, own, 0], [0.0, 0.0, 0]])
    assert said == "" if seen else "other free parameters do the same" in said


def test_a_number_with_a_prior_may_stay_untold():
    made = problem([[1, 0, 0], [0, 0, 0]], [0.0, 0.0], ("k", "phi"), {"phi": Prior(0.5, 0.1)})
    refuse_untold(made, [made.space.start()])


def two_starts(*moves, spread=1.0, free=("k", "phi")):
    """A problem in which phi moves a value by so much at each start, over the spread of the starts."""
    made = problem(np.eye(3), np.zeros(3), free)
    axes = [axis._replace(coordinate=Linear(1.0, WIDEST, spread)) for axis in made.space.axes]
    rows = iter([np.array([[1.0, 0.0], [0.0, each], [0.0, 0.0]]) for each in moves])
    space = Space(tuple(axes), BASE, KNOWN)
    return SimpleNamespace(space=space, priors={}, data=made.data, evaluate=lambda u: (np.zeros(3), next(rows)))


def test_what_shows_at_any_start_is_told():
    nowhere, starts = "phi is not identifiable: it moves nothing", [BASE[:2], BASE[:2]]
    for moves in ((1.0, 1e-9), (1e-9, 1.0), (np.nan, 1.0), (np.nan, np.nan)):
        refuse_untold(two_starts(*moves), starts)
    for moves in ((1e-9, 1e-8), (np.nan, 1e-9)):
        with pytest.raises(ParameterError, match=nowhere):
            refuse_untold(two_starts(*moves), starts)
    refuse_untold(two_starts(1e-4, 1e-4, spread=20.0), starts)
    with pytest.raises(ParameterError, match=nowhere):
        refuse_untold(two_starts(5e-3, 5e-3, spread=0.1), starts)


def test_one_start_at_which_others_do_not_do_the_same_is_enough():
    for order in (1, -1):
        made = problem(np.eye(3), np.zeros(3), ("k", "phi"))
        rows = iter([np.array([[3.0, 1.0], [0.0, own], [0.0, 0.0]]) for own in (1.0, 1e-9)[::order]])
        found = SimpleNamespace(
            space=made.space, priors={}, data=made.data, evaluate=lambda u, rows=rows: (0, next(rows))
        )
        refuse_untold(found, [BASE[:2], BASE[:2]])


def with_data(free, *data):
    about = quantities(Soil)
    axes = tuple(Axis(name, about[name], Linear(1.0, WIDEST), -50.0, 50.0) for name in free)
    for one in data:
        one.predictor = lambda asked: lambda fields: (np.zeros(3), np.eye(3)[:, : len(free)])
    return Problem(list(data), Space(axes, np.ones(len(free)), free), {})


def refusal(made):
    try:
        refuse_untold(made, [made.space.start()])
    except ParameterError as error:
        return str(error)
    return ""


def test_one_set_that_tells_a_number_is_enough():
    silent, telling = (Measured(np.eye(3), np.zeros(3)) for _ in range(2))
    silent.tells = frozenset({"k"})
    assert refusal(with_data(("n",), silent, telling)) == ""
    assert refusal(with_data(("n",), silent)).startswith("n is not identifiable from made data, which tells k only: ")
    silent.tells = frozenset({"k", "phi", "theta_1"})
    assert refusal(with_data(("n",), silent)).startswith("n is not identifiable from made data: sinkage under")


@pytest.mark.parametrize(
    ("tells", "said"),
    [
        ((), ""),
        (("exit_ratio",), ", which tells exit_ratio only"),
        (("k_1", "k_2"), ", which tells k_1, k_2 only"),
        (("k_1", "k_2", "c"), ""),
    ],
)
def test_refusal_lists_channels_by_count_not_by_name_length(tells, said):
    silent = Measured(np.eye(3), np.zeros(3))
    silent.tells = frozenset(tells)
    assert refusal(with_data(("n",), silent)).startswith(f"n is not identifiable from made data{said}: sinkage under")


def test_c_and_phi_need_loads_and_two_moduli_two_widths():
    bare, plain, wide = (
        Measured(np.eye(3), np.zeros(3), loads=()),
        *(Measured(np.eye(3), np.zeros(3)) for _ in range(2)),
    )
    assert "from one load (no load is known)" in refusal(with_data(("c", "phi"), bare))
    single = Measured(np.eye(3), np.zeros(3), loads=(5.0,))
    assert "from one load (all runs carry about 5 N)" in refusal(with_data(("c", "phi"), single))
    assert refusal(with_data(("c", "n"), bare)) == ""
    wide.wheel = Wheel(b=0.08)
    assert "from one wheel width (0.05 m)" in refusal(with_data(("k_1", "k_2"), plain))
    assert refusal(with_data(("k_1", "k_2"), plain, wide)) == ""
    assert refusal(with_data(("k_1", "n"), plain)) == ""


@pytest.mark.parametrize(("ratio", "one"), [(1.49, True), (1.51, False)])
def test_loads_within_half_again_are_one_load(ratio, one):
    with_c = ("c", "phi")
    about = quantities(Soil)
    axes = tuple(Axis(name, about[name], Linear(1.0, WIDEST), -50.0, 50.0) for name in with_c)
    data = Measured(np.eye(3), np.zeros(3), loads=(6.0, 6.0 * ratio, 6.0))
    data.predictor = lambda free: lambda fields: (np.zeros(3), np.eye(3)[:, :2])
    made = Problem([data], Space(axes, np.array([100.0, 0.5]), with_c), {})
    if one:
        with pytest.raises(
            ParameterError, match=r"not identifiable together from one load \(all runs carry about 6 N\)"
        ):
            refuse_untold(made, [made.space.start()])
    else:
        refuse_untold(made, [made.space.start()])


# --- the fit's bookkeeping -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("freedom", [1, 10, 200])
def test_misfit_begins_at_a_p_value_of_one_in_a_thousand(freedom):
    limit = chi2_law.isf(1e-3, freedom)
    assert misfit(0.999 * limit, freedom) == 1.0
    assert misfit(1.001 * limit, freedom) == pytest.approx(math.sqrt(1.001 * limit / freedom))


def test_without_freedom_there_is_no_misfit():
    assert misfit(1e6, 0) == 1.0


def test_starts_are_the_soil_and_points_within_spread_and_bounds():
    low, *drawn = scatter(PLAIN, Search(starts=400, seed=1))
    assert low == pytest.approx(BASE)
    off = np.array(drawn) - BASE
    assert np.abs(off).max(axis=0) == pytest.approx([1.0] * 3, abs=0.02)
    assert off.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.1)
    wide = tuple(axis._replace(coordinate=Linear(1.0, WIDEST, spread=3.0)) for axis in PLAIN.space.axes)
    far = np.array(scatter(SimpleNamespace(space=Space(wide, BASE, KNOWN)), Search(starts=400, seed=1))[1:])
    assert far - BASE == pytest.approx(3.0 * off)
    narrow = SimpleNamespace(space=PLAIN.space)
    narrow.space = Space(tuple(axis._replace(low=0.0, high=1.2) for axis in PLAIN.space.axes), BASE, KNOWN)
    held = np.array(scatter(narrow, Search(starts=50)))
    assert (held.min(), held.max()) == (0.0, 1.2)


def test_starts_that_end_within_a_hundredth_of_chi2_agree():
    ends = [(1.0, 3.0), (1.0095, 3.1), (1.0105, 7.0), (1.02, 7.1), (4.0, 9.0), (np.inf, None)]
    made = [StartResult(None if u is None else np.array([0.0, u / 10, 0.0]), chi2, "") for chi2, u in ends]
    found = _agreement(PLAIN, made)
    assert (found.tried, found.converged, found.agreed) == (6, 5, 2)
    assert [chi2 for chi2, _ in found.others] == [1.0105, 4.0]
    assert found.others[0][1]["phi"] == pytest.approx(0.7)


def test_the_fit_is_where_the_lowest_start_ended():
    ends = [StartResult(BASE + 1.0, 7.0, ""), StartResult(BASE, 3.0, ""), StartResult(None, np.inf, "did not settle")]
    found = _lowest(PLAIN, ends)
    assert (found.chi2, found.u) == (3.0, pytest.approx(BASE))
    assert found.covariance == pytest.approx(np.eye(3))
    with pytest.raises(OptimisationError, match=r"none of 1 starts converged \(did not settle\); start from"):
        _lowest(PLAIN, ends[2:])


def test_each_channel_has_its_own_error_and_chi2():
    data = problem(np.eye(3)[[0, 1, 2, 0]], [0.01, 0.7, 1.3, 0.01 + 0.4], sd=0.1, parts=2)
    first, second = _channel_fits(data, data.space.start())
    assert (first.points, first.rmse, first.chi2) == (2, pytest.approx(0.2 / math.sqrt(2)), pytest.approx(4.0))
    assert (second.points, second.rmse, second.chi2) == (2, pytest.approx(0.5 / math.sqrt(2)), pytest.approx(25.0))


def test_walkers_start_as_the_fit_scatters_within_the_bounds():
    """SDs of 0.1, 0.05 and, where the data tell little, a quarter of the spread of the starts."""
    made = problem(np.diag([1.0, 2.0, 1e-3]), [0.01, 1.0, 1e-3], sd=0.1)
    walkers = _walkers(made, Chain(walkers=4000, seed=2))
    assert walkers.mean(axis=0) == pytest.approx(BASE, abs=0.02)
    assert walkers.std(axis=0) == pytest.approx([0.1, 0.05, 0.25], rel=0.05)
    near = problem([[1, 0, 0], [0, 1, 0], [0, 0, 1]], BASE)
    near.space = Space(tuple(axis._replace(low=0.0, high=1.2) for axis in PLAIN.space.axes), BASE, KNOWN)
    held = _walkers(near, Chain(walkers=400))
    sd = 0.25
    assert held.min() == pytest.approx(1e-3 * sd)
    assert held.max() == pytest.approx(1.2 - 1e-3 * sd)


def test_the_pressure_is_that_of_the_narrowest_wheel():
    """It must be positive under all of them, where k_2 stands for it."""
    slips, factors = [0.1, 0.3, 0.5], [0.02, 0.05, 0.08]
    data = [TractionPoints(slips, factors, 0.03, wheel=Wheel(b=b)) for b in (0.08, 0.03, 0.05)]
    found = build(data, Soil(k_1=2e4, k_2=5e5), ("k_1",), {"k_1": Prior(2e4, 1e3)}).space
    assert found.start() == pytest.approx([math.log(2e4 + 5e5 * 0.03)])


@pytest.mark.parametrize("values", [[0.01, 20.0], [1e-9, 0.01]])
def test_a_profile_keeps_within_the_bounds_at_all_its_values(values):
    data = TractionPoints([0.1, 0.3, 0.5, 0.8], [0.02, 0.05, 0.08, 0.1], 0.03)
    with pytest.raises(ParameterError, match="the profile of k leaves"):
        profile(data, Soil(), ("k",), "k", np.array(values))


def test_an_error_without_a_unit_leaves_no_gap():
    one = Estimate("k", "m", 1.0, 0.1, 0.5, 1.5, Verdict.FOUND, "found")
    channels = (ChannelFit("traction factor", "", 18, 0.00474, 4.7), ChannelFit("sinkage", "m", 15, 0.00449, 839.3))
    ones = (np.eye(1), np.ones(1), np.eye(1), channels)
    said = Identification((one,), *ones, 844.0, 31, 1.0, Starts(1, 1, 1, ()), Soil()).report()
    assert "  traction factor: RMSE 0.00474 over 18 points, chi2 4.7\n" in said
    assert "  sinkage: RMSE 0.00449 m over 15 points, chi2 839.3\n" in said


@pytest.mark.parametrize(("widened", "said"), [(1.0, False), (1.5, True)])
def test_a_report_says_that_its_intervals_are_widened(widened, said):
    one = Estimate("k", "m", 1.0, 0.1, 0.5, 1.5, Verdict.FOUND, "found")
    ones = (np.eye(1), np.ones(1), np.eye(1), ())
    made = Identification((one,), *ones, 3.0, 2, widened, Starts(1, 1, 1, ()), Soil())
    assert ("are widened 1.5 times" in made.report()) == ("are widened" in made.report()) == said
    assert made.as_dict()["parameters"]["k"]["verdict"] == "found"


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("rad", "x = 57.3 +- 5.7 deg, 95 % in [28.65, 85.94]: found"),
        ("m", "x = 1 +- 0.1 m, 95 % in [0.5, 1.5]: found"),
        ("s", "x = 1 +- 0.1 s, 95 % in [0.5, 1.5]: found"),
        ("", "x = 1 +- 0.1 , 95 % in [0.5, 1.5]: found"),
    ],
)
def test_a_line_of_a_report_is_in_the_readers_unit(unit, said):
    assert _line(Estimate("x", unit, 1.0, 0.1, 0.5, 1.5, Verdict.FOUND, "found")) == said


# --- sampling --------------------------------------------------------------------------------------------------------


def test_sample_interval_excludes_equal_tails():
    found = Posterior(("k", "phi"), np.column_stack([np.zeros(1001), np.arange(1001.0)]), 1.0, 0.5)
    assert found.interval("phi") == pytest.approx((25.0, 975.0))
    assert found.interval("phi", 0.5) == pytest.approx((250.0, 750.0))


def test_density_is_zero_where_any_number_is_outside_its_bounds():
    inside = PLAIN.space.start()
    for at, side in ((0, 60.0), (1, -60.0), (2, 60.0)):
        outside = inside.copy()
        outside[at] = side
        assert log_density(PLAIN, outside) == -math.inf
    assert log_density(PLAIN, inside) == 0.0


class Sampler:
    """What of emcee is used: a chain of `memory` steps whose samples count up."""

    memory = 0.0

    def __init__(self, walkers, numbers, density):
        self.shape, self.acceptance_fraction = (walkers, numbers), np.array([0.2, 0.4])

    def run_mcmc(self, start, steps):
        assert start.shape == self.shape
        self.steps = steps

    def get_autocorr_time(self, quiet, tol):
        assert quiet, "a short chain is judged here"
        assert tol == 0
        return np.array([1.0, self.memory])

    def get_chain(self, discard, flat):
        assert flat
        walkers, numbers = self.shape
        return np.zeros((walkers * (self.steps - discard), numbers))


@pytest.mark.parametrize(("memory", "enough"), [(49.9, True), (50.1, False)])
def test_a_chain_is_ten_times_its_memory_after_the_burn_in(monkeypatch, memory, enough):
    monkeypatch.setattr(sampling, "_emcee", lambda: SimpleNamespace(EnsembleSampler=Sampler))
    monkeypatch.setattr(Sampler, "memory", memory)
    data = TractionPoints([0.1, 0.3, 0.5, 0.8], [0.02, 0.05, 0.08, 0.1], 0.03)
    chain = Chain(walkers=8, steps=600, burn_in=100)
    if enough:
        found = sampling.posterior(data, Soil(), ("phi",), chain=chain)
        assert (found.samples.shape, found.autocorrelation) == ((8 * 500, 1), memory)
        assert found.acceptance == pytest.approx(0.3)
    else:
        with pytest.raises(OptimisationError, match="its memory is 50 of 600 steps; give at least 1002"):
            sampling.posterior(data, Soil(), ("phi",), chain=chain)


@pytest.mark.parametrize(
    ("channels", "exact", "prior"),
    [
        ((DrawbarPull, Torque), (), (50e3, 35e3)),
        ((DrawbarPull, Torque), ("k_1",), None),
        ((DrawbarPull, Sinkage), (), None),
    ],
)
def test_modulus_is_uncertain_if_needed_and_unmeasured(channels, exact, prior):
    """A 60 mm wheel without sinkage said phi = 14.1 deg [13.7, 14.7], found, at Table 1's k_1; it is [11, 20] of it."""
    ones = np.ones(4)
    rig = WheelRig(Wheel(0.06, 0.05), 0.2 * ones, 10.0, tuple(channel(ones * 0.01, 0.01) for channel in channels))
    soil = Soil(k_1=50e3, k_2=0.0)
    free, priors = free_unmeasured_modulus(rig, soil, ("k", "phi"), {}, frozenset(exact))
    assert free == (("k", "phi", "k_1") if prior else ("k", "phi"))
    assert priors == ({"k_1": Prior(*prior)} if prior else {})
    assert free_unmeasured_modulus(rig, soil, ("k", "n"), {})[0] == ("k", "n")
    known = free_unmeasured_modulus(dataclasses.replace(rig, declared={"k_1": 50e3}), soil, ("k",), {})[1]
    assert known == ({"k_1": Prior(50e3, 17.5e3)} if Sinkage not in channels else {})
