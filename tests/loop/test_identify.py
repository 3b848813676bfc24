"""`identify`: the loop's own fit with nothing missing, known truths, what each number depends on, and refusals."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Wheel, close_the_loop
from rover_pin.base.errors import ParameterError
from rover_pin.estimation.parameter import Prior
from rover_pin.experiments.wheel_rig.experiment import join_sets
from rover_pin.loop.identify import identify
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet
from tests.oracle import rig_generator as hidden

DATA = Path(__file__).parents[2] / "studies" / "data"
SMOOTH, LOG = DATA / "cmu-smooth-wheel", DATA / "steepening-slope"
KINDS = (DrawbarPull, Torque, Sinkage)
TRUTH = {"k": 0.008, "phi": 0.5, "n": 1.1, "k_1": 3e4, "k_2": 8e5}
WHEELS = {"narrow": (0.0625, 0.05, (15.0, 25.0)), "wide": (0.09, 0.12, (60.0,))}


def made(name):
    """What a wheel does in the one sand, by a generator that shares no code: rows (S, W, pull, torque, sinkage)."""
    r, b, loads = WHEELS[name]
    bed = hidden.Rig("none", K=TRUTH["k_1"] + TRUTH["k_2"] * b)
    bed.r, bed.b = r, b
    return np.array([(S, W, *bed.run(W, S)[:3]) for S in (0.0, 0.15, 0.3, 0.5, 0.75) for W in loads])


TABLES = {name: made(name) for name in WHEELS}


def rig(name, seed=0, times=1.0):
    r, b, _ = WHEELS[name]
    rows = TABLES[name]
    noise = times * np.random.default_rng([seed, r > 0.07]).normal(size=(len(rows), 3)) * hidden.SD
    channels = tuple(kind(rows[:, 2 + i] + noise[:, i], hidden.SD[i]) for i, kind in enumerate(KINDS))
    declared = {"c": 200.0, "n": 1.1, "exit_ratio": 0.15}
    sds = {"c": 1.0, "exit_ratio": 1e-3}
    return RigSet(Wheel(r, b), rows[:, 0], rows[:, 1], channels, name, declared=declared, doubts=sds)


# --- where a number's variance comes from ----------------------------------------------------------------------------


def test_a_number_depends_on_its_assumption_until_it_is_stated():
    """The smooth wheel's phi goes with where the contact ends, which nobody measured."""
    open_end = identify(SMOOTH)
    assert open_end["phi"].depends_on == ("soil.exit_ratio",)
    assert not open_end["phi"].is_found
    assert open_end["exit_ratio"].is_as_known
    identification = identify(SMOOTH, {"exit_ratio": Prior(0.14, 0.01)})
    assert identification["phi"].is_found
    assert identification["phi"].depends_on == ()
    width = [identified["phi"].number.high - identified["phi"].number.low for identified in (open_end, identification)]
    assert width[1] < 0.6 * width[0]


# --- known truths ----------------------------------------------------------------------------------------------------


def test_intervals_of_two_wheels_hold_the_truth_and_are_narrower():
    """Widths that differ part k_1 from k_2, which no single wheel does; what each wheel tells, both tell closer."""
    covered, width = [], {"narrow": [], "both": []}
    for seed in range(10):
        sets = join_sets([rig("narrow", seed), rig("wide", seed)])
        fits = {"narrow": identify(sets.sets[0]), "both": identify(sets)}
        rows = [fits["both"][name].number for name in TRUTH]
        covered += [row.low <= TRUTH[name] <= row.high for name, row in zip(TRUTH, rows, strict=True)]
        for name, fit in fits.items():
            width[name].append(
                [fit[number_name].number.high - fit[number_name].number.low for number_name in ("k", "phi", "n")]
            )
    assert sum(covered) >= 43, "95 % of 50, three SDs of a count below"
    assert (np.mean(width["both"], axis=0) < np.mean(width["narrow"], axis=0)).all()


def test_noiseless_rig_returns_the_soil():
    identification = identify(join_sets([rig("narrow", times=0.0), rig("wide", times=0.0)]))
    for name in ("k", "phi", "n"):
        assert identification[name].number.value == pytest.approx(TRUTH[name], rel=0.01)
        assert identification[name].is_found
    assert identification.misfit < 0.01


@pytest.mark.slow
def test_numbers_are_those_of_the_loop_before_anything_is_added():
    by_loop = {number.name: number for number in close_the_loop(SMOOTH).before.numbers}
    identification = identify(SMOOTH)
    assert {estimate.number.name for estimate in identification.estimates} == by_loop.keys()
    for estimate in identification.estimates:
        row = by_loop[estimate.number.name]
        assert estimate.number.value == pytest.approx(row.value, rel=1e-6)
        assert (estimate.number.low, estimate.number.high) == pytest.approx((row.low, row.high), rel=1e-3)


# --- what is stated --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sd", [1e-4, 0.002])
def test_an_uncertain_size_is_fitted_within_what_is_stated(sd):
    identification = identify(SMOOTH, {"wheel.r": Prior(0.061, sd)})
    assert identification["r"].number.declared
    assert abs(identification["r"].number.value - 0.061) < 2.0 * sd
    assert identification["r"].prior_shares["wheel.r"] <= 1.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"priors": {"phj": Prior(0.5, 0.1)}}, "'phj'.*'phi'"),
        ({"priors": {"phi": Prior(50.0, 1.0)}}, "soil.phi = 50 rad"),
        ({"fixed": {"n": 11.0}}, "soil.n = 11"),
        ({"fixed": {"sand.n": 1.0}}, "no 'sand' to fit"),
    ],
)
def test_what_cannot_be_stated_is_refused(value, message):
    with pytest.raises(ParameterError, match=message):
        identify(SMOOTH, **value)


# --- data ------------------------------------------------------------------------------------------------------------


def test_wheels_askew_and_errors_of_the_rig_are_fitted(tmp_path):
    askew = identify(DATA / "cmu-smooth-wheel-angles")
    assert [channel.name for channel in askew.channels] == ["drawbar pull", "sinkage", "side force"]
    text = (SMOOTH / "rig.toml").read_text() + '\n[rig]\nsinkage_zero = { value = 0.0, sd = 2.0, unit = "mm" }\n'
    for name in ("points.csv", "penetration.csv"):
        (tmp_path / name).write_bytes((SMOOTH / name).read_bytes())
    (tmp_path / "rig.toml").write_text(text)
    assert identify(tmp_path)["sinkage_zero"].number.declared


def test_the_log_of_the_climb_says_which_soil_it_was():
    """Declared k = 3.5 mm, made with 1.5 mm and 30 deg; k depends on the angle at which wheels are taken to sink."""
    identification = identify(LOG)
    k, phi = identification["k"], identification["phi"]
    assert k.number.low < 0.0015 < k.number.high < 0.0025
    assert phi.number.low < math.radians(30.0) < phi.number.high
    assert k.depends_on[0] == "soil.theta_1"
    assert "motor.resistance" in identification["phi"].prior_shares


def test_the_command_prints_the_same_as_text_and_as_json(run):
    code, out, _ = run("identify", SMOOTH, "--prior", "exit_ratio=0.14:0.01", "--json")
    assert code == 0
    values = json.loads(out)
    assert values["parameters"]["soil.phi"]["found"]
    text = run("identify", SMOOTH, "--prior", "exit_ratio=0.14:0.01")[1]
    assert f"{math.degrees(values['parameters']['soil.phi']['value']):.4g} deg" in text
    shares = values["parameters"]["soil.phi"]
    assert sum(shares["prior_shares"].values()) + shares["data_share"] == pytest.approx(1.0)


def test_a_log_without_motors_is_identified_from_its_drives(run, tmp_path):
    """An imported log declares no motor, so that no torque and no traction factor is known: its drives are replayed."""
    from tests.importing import recordings

    recordings.plain(recordings.truth(), Path())
    assert run("import-log", "plain.csv", "--rover", "cart")[0] == 0
    code, out, err = run("identify", "plain", "--json")
    assert code == 0, err
    report = json.loads(out)
    assert {"soil.phi", "soil.k", "soil.k_1"} <= report["parameters"].keys()
    assert report["misfit"] < 2.0


@pytest.mark.parametrize("command", ["close-loop", "check-data"])
def test_a_table_alone_is_referred_to_the_commands_that_read_one(command, run):
    Path("my.csv").write_text("slip,load_N,drawbar_pull_N\n0.1,50,4\n")
    code, _, err = run(command, "my.csv")
    assert code == 2
    assert "rover-pin init" in err
    assert "rover-pin import-log" in err
