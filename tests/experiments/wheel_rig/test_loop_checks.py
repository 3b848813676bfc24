"""What accompanies a verdict: residual tests, the choice made anew, profiles, cautions; and how blind tests score."""

import html
import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from rover_pin import Wheel, close_the_loop
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.wheel_rig.diagnostics import NEIGHBOURS, NEXT_RUN, ORDER, SLIP_SQUARED, residual_tests
from rover_pin.measurements.channel import DrawbarPull, Sinkage
from rover_pin.measurements.rig_set import RigSet
from rover_pin.report.words import human
from rover_pin.simulation.model.effect_files import package_effects

STUDIES = Path(__file__).parents[3] / "studies"
DATA = STUDIES / "data"


def loaded(name):
    """A study, which imports others of its folder."""
    sys.path.insert(0, str(STUDIES))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(STUDIES))


score = loaded("blind_score")


# --- residual tests --------------------------------------------------------------------------------------------------

RUNS = 36


def plain_set(loads):
    """Slips and loads in random order; what was measured does not matter here."""
    rng = np.random.default_rng(4)
    slip = rng.permutation(np.repeat(np.linspace(0, 0.85, 12), 3))
    load = rng.choice(loads, RUNS)
    sunk = Sinkage(np.linspace(0.01, 0.02, RUNS), np.full(RUNS, 1e-3))
    pull = DrawbarPull(np.linspace(-1, 1, RUNS), np.full(RUNS, 0.1))
    return RigSet(Wheel(), slip, load, (pull, sunk))


def p_of(tests, channel, against):
    return next(test.p for test in tests if (test.channel, test.against) == (channel, against))


@pytest.mark.parametrize("against", ["slip", SLIP_SQUARED, "load", ORDER])
def test_trend_of_a_residual_is_attributed_to_its_cause_alone(against):
    data = plain_set((10.0, 20.0))
    slip = np.asarray(data.slip)
    cause = {
        "slip": slip,
        SLIP_SQUARED: (slip - slip.mean()) ** 2,
        "load": np.asarray(data.load),
        ORDER: np.arange(RUNS),
    }[against]
    noise = np.random.default_rng(1).normal(size=(2, RUNS))
    noise[1] += 3 * (cause - cause.mean()) / cause.std()
    tests = residual_tests(data, noise, 0)
    assert p_of(tests, "sinkage", against) <= 0.002
    assert p_of(tests, "drawbar pull", against) > 0.01
    others = {"slip", SLIP_SQUARED, "load", ORDER} - {against}
    assert all(p_of(tests, "sinkage", second) > 0.002 for second in others)


def test_whiteness_sees_what_lives_between_neighbours():
    data = plain_set((10.0,))
    slow = np.sin(np.arange(RUNS) / 3)
    tests = residual_tests(data, np.vstack([slow, np.sin(9 * np.asarray(data.slip))]), 0)
    assert p_of(tests, "drawbar pull", NEXT_RUN) < 0.01 < p_of(tests, "drawbar pull", NEIGHBOURS)
    assert p_of(tests, "sinkage", NEIGHBOURS) < 0.01 < p_of(tests, "sinkage", NEXT_RUN)
    assert not any(test.against == "load" for test in tests)


def test_p_values_of_noise_are_uniform():
    data, rng = plain_set((10.0, 20.0)), np.random.default_rng(2)
    p = [test.p for seed in range(20) for test in residual_tests(data, rng.normal(size=(2, RUNS)), seed)]
    assert kstest(p, "uniform").pvalue > 0.01


# --- cautions --------------------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_ding_s_wheel_comes_with_its_cautions(tmp_path):
    verdict = close_the_loop(DATA / "ding-2011-smooth", out=tmp_path)
    assert "folds" in verdict.chosen_again
    assert any(caution.startswith("phi = ") and "sits away from" in caution for caution in verdict.cautions)
    assert any("times its noise" in caution for caution in verdict.cautions)
    page = html.unescape((tmp_path / "report.html").read_text()).replace("\N{NO-BREAK SPACE}", " ")
    kinds = package_effects()
    heads = (caution.partition(":")[0] for caution in verdict.cautions)
    quoted = [
        head if head in verdict.vetoes else caution for head, caution in zip(heads, verdict.cautions, strict=True)
    ]
    assert all(
        human(caution, kinds)[1:] in page for caution in quoted
    )  # capital letters begin them; a veto is said once


# --- the score of blind tests ----------------------------------------------------------------------------------------


def case(kind, truth, answer, *candidates, detectable=True):
    candidates = tuple(tuple(candidate.split("+")) for candidate in candidates)
    return score.Case(
        "made", score.Kind[kind], tuple(truth.split("+")) if truth else (), answer, candidates, detectable
    )


@pytest.mark.parametrize(
    ("example", "worth"),
    [
        (case("SINGLE", "A", Answer.NAMED, "A"), "RIGHT"),
        (case("SINGLE", "A", Answer.SET, "B", "A"), "IN_SET"),
        (case("SINGLE", "A", Answer.NAMED, "B"), "WRONG"),
        (case("SINGLE", "A", Answer.NAMED, "A+B"), "EXTRA"),
        (case("SINGLE", "A", Answer.NONE_FITS), "UNKNOWN"),
        (case("SINGLE", "A", Answer.NONE_NEEDED), "SILENT"),
        (case("PAIR", "A+B", Answer.NAMED, "B+A"), "RIGHT"),
        (case("PAIR", "A+B", Answer.NAMED, "B"), "PART"),
        (case("PAIR", "A+B", Answer.NAMED, "C"), "WRONG"),
        (case("NULL", "", Answer.NAMED, "A"), "WRONG"),
        (case("NULL", "", Answer.NONE_NEEDED), "SILENT"),
        (case("OFF_LIST", "odd", Answer.SET, "A", "B"), "WRONG"),
        (case("OFF_LIST", "odd", Answer.NONE_FITS), "UNKNOWN"),
    ],
)
def test_what_an_answer_is_worth(example, worth):
    assert example.outcome is score.Outcome[worth]


@pytest.mark.parametrize(("count", "of"), [(0, 20), (1, 24), (58, 61), (30, 30)])
def test_wilson_s_interval_is_where_the_score_test_rejects(count, of):
    low, high = score.wilson(count, of)
    for end in (low, high):
        if 0 < end < 1:
            z = abs(count / of - end) / math.sqrt(end * (1 - end) / of)
            assert z == pytest.approx(1.959964)


def test_a_case_that_is_kept_is_made_once_and_read_as_it_was(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(STUDIES)
    case_module, score_module = (importlib.import_module(name) for name in ("kept.case", "blind_score"))
    size = score_module.Size("Ploughing.a_b", 0.5, 0.52, math.inf, 0.6)
    blind_case = score_module.Case(
        "x, white, 7",
        score_module.Kind.PAIR,
        ("Ploughing", "ExitAngle"),
        score_module.Answer.SET,
        (("A", "B"), ("C",)),
        True,
        (size,),
    )
    assert str(case_module.kept(tmp_path / "cases" / "7.json", lambda: blind_case)) == str(blind_case)
    assert str(case_module.kept(tmp_path / "cases" / "7.json", lambda: pytest.fail("made again"))) == str(blind_case)
