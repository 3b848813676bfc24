"""`identify` of several rig sets in one sand: one soil under wheels of their own, against sands of a known truth."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.cli.app import app
from rover_pin.contact import Soil, Wheel
from rover_pin.experiments.joint_rig.sets import read_joint
from rover_pin.identification.arc_uncertainty import free_unmeasured_modulus
from rover_pin.identification.held import held_numbers
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.one_sand import sand_of
from rover_pin.loop.data_check import checked_evidence
from rover_pin.loop.identified import identified
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.pressed import Trial
from rover_pin.measurements.reading import read_evidence
from rover_pin.measurements.wheel_rig import WheelRig
from tests.oracle import rig_generator as hidden

DATA = Path(__file__).parents[2] / "studies" / "data"
KINDS = (DrawbarPull, Torque, Sinkage)
TRUTH = {"k": 0.008, "phi": 0.5, "n": 1.1, "k_1": 3e4, "k_2": 8e5}
FREE = tuple(TRUTH)
START = Soil(c=200.0, n=1.0, exit_ratio=0.15, k_1=5e4, k_2=0.0)
WHEELS = {"narrow": (0.0625, 0.05, (15.0, 25.0)), "wide": (0.09, 0.12, (60.0,))}
ONE = Search(starts=1)


def made(name):
    """What a wheel does in the one sand, by a generator that shares no code: rows (S, W, pull, torque, sinkage)."""
    r, b, loads = WHEELS[name]
    bed = hidden.Rig("none", K=TRUTH["k_1"] + TRUTH["k_2"] * b)
    bed.r, bed.b = r, b
    return np.array([(S, W, *bed.run(W, S)[:3]) for S in (0.0, 0.15, 0.3, 0.5, 0.75) for W in loads])


TABLES = {name: made(name) for name in WHEELS}


def rig(name, seed=0, **how):
    r, b, _ = WHEELS[name]
    rows = TABLES[name]
    noise = np.random.default_rng([seed, r > 0.07]).normal(size=(len(rows), 3)) * hidden.SD
    channels = tuple(kind(rows[:, 2 + i] + noise[:, i], hidden.SD[i]) for i, kind in enumerate(KINDS))
    return WheelRig(Wheel(r, b), rows[:, 0], rows[:, 1], channels, name, **how)


def pair(seed=0, **how):
    return rig("narrow", seed, **how), rig("wide", seed, **how)


# --- the joint fit ---------------------------------------------------------------------------------------------------


def test_intervals_of_two_wheels_hold_the_truth_and_are_narrower():
    """Widths that differ part k_1 from k_2, which no single wheel does; what each wheel tells, both tell closer."""
    held, width = [], {name: [] for name in ("narrow", "wide", "both")}
    for seed in range(10):
        sets = pair(seed)
        both = identify(sets, START, FREE, search=ONE)
        held += [one.low <= TRUTH[one.name] <= one.high for one in both.estimates]
        fits = {"both": both} | {
            each.name: identify(each, START.replace(k_2=TRUTH["k_2"]), ("k", "phi", "n", "k_1"), search=ONE)
            for each in sets
        }
        for name, fit in fits.items():
            width[name].append([fit[each].high - fit[each].low for each in ("k", "phi", "n")])
    mean = {name: np.mean(rows, axis=0) for name, rows in width.items()}
    assert len(held) == 50
    assert sum(held) >= 43, "95 % of 50, three SDs of a count below"
    assert (mean["both"] < mean["wide"]).all()
    assert (mean["both"] < 0.65 * mean["narrow"]).all()


def test_a_set_cut_in_two_answers_as_the_whole():
    whole = rig("narrow", declared={"n": 1.1}, doubts={"n": 0.02}, beside={"bulk_density": 1500.0})
    low = whole.slip < 0.2
    parts = [dataclasses.replace(whole.rows(keep), name=name) for name, keep in (("a", low), ("b", ~low))]
    alone, cut = (identified(each, START.replace(n=1.1), ("k", "phi", "k_1")) for each in (whole, parts))
    for one, other in zip(alone.identification.estimates, cut.identification.estimates, strict=True):
        assert (one.name, one.verdict_text) == (other.name, other.verdict_text)
        assert (one.value, one.low, one.high) == pytest.approx((other.value, other.low, other.high), rel=1e-5)
    assert alone.identification.chi2 == pytest.approx(cut.identification.chi2)
    rows = {one.fixed.name: one for one in alone.identification.fixed}
    assert [one.fixed.name for one in cut.identification.fixed] == list(rows)
    for one in cut.identification.fixed:
        same = rows[one.fixed.name]
        assert (one.fixed.low, one.fixed.high) == (same.fixed.low, same.fixed.high)
        for name, ends in one.refitted.items():
            assert ends == pytest.approx(same.refitted[name], rel=1e-4)
    assert cut.unused == alone.unused == ("bulk_density",)


def test_residuals_are_told_by_set():
    sets = pair()
    found = identified(sets, START, FREE)
    rows = [(one.set, one.name, one.points) for one in found.identification.channels]
    names = ("drawbar pull", "torque", "sinkage")
    assert rows == [*(("narrow", name, 10) for name in names), *(("wide", name, 5) for name in names)]
    assert [row["set"] for row in found.as_dict()["channels"]] == ["narrow"] * 3 + ["wide"] * 3
    assert "  wide: torque: RMSE " in found.report()
    alone = identified(sets[0], START, ("k", "phi"))
    assert "set" not in alone.as_dict()["channels"][0]
    assert "  torque: RMSE " in alone.report()


# --- what is held ----------------------------------------------------------------------------------------------------


def test_differing_wheel_sizes_are_per_set_and_equal_shared():
    sets = pair()
    held = [one.name for one in held_numbers(sets, START, ("k", "phi"))]
    assert held == [
        "r of narrow", "r of wide", "b of narrow", "b of wide", "c", "k_1", "k_2", "n", "theta_1", "theta_2",
        "exit_ratio",
    ]  # fmt: skip
    third = dataclasses.replace(sets[0], name="again", wheel=Wheel(WHEELS["narrow"][0], 0.055))
    rows = {one.name: one for one in held_numbers((*sets, third), START, ("k", "phi"))}
    assert "r of narrow and again" in rows
    assert {"r of wide", "b of narrow", "b of again"} <= set(rows)
    alike = held_numbers((sets[0], dataclasses.replace(sets[0], name="again")), START, ("k", "phi"))
    assert alike[0].name == "r"
    assert alike[0].source == "declared with the data, every set's alike"


def test_a_size_moves_its_own_wheels_and_no_others():
    sets = pair()
    free = ("k", "phi", "n", "k_1", "k_2")
    found = identified(sets, START, free).identification
    for at, name in enumerate(WHEELS):
        row = next(one for one in found.fixed if one.fixed.name == f"r of {name}")
        changed = list(sets)
        changed[at] = dataclasses.replace(sets[at], wheel=sets[at].wheel.replace(r=row.fixed.high))
        fresh = identify(changed, START, free, search=Search(starts=2))
        for each in free:
            assert row.refitted[each][1] == pytest.approx(
                fresh[each].value, abs=0.02 * (fresh[each].high - fresh[each].low)
            )


def test_width_independent_modulus_is_assumed_for_several_widths():
    """k_2 = 0 is no assumption under one width; under two it is wrong here, and the fit misses."""
    row = {one.name: one for one in held_numbers(pair(), START, ("k", "phi", "k_1"))}["k_2"]
    assert (row.value, row.low, row.high) == pytest.approx((0.0, 0.0, 5e4 / 0.05))
    assert row.doubt == "none or all of k_1 + k_2 b at b = 0.05 m: assumed"
    assert row.ends == ({}, {"k_2": row.high, "k_1": 0.0})
    other = {one.name: one for one in held_numbers(pair(), START.replace(k_1=0.0, k_2=1e6), ("k", "k_2"))}["k_1"]
    assert (other.low, other.high) == pytest.approx((0.0, 5e4))
    assert other.ends == ({}, {"k_1": other.high, "k_2": 0.0})
    both = {one.name for one in held_numbers(pair(), START.replace(k_2=1e5), ("k",))}
    assert {"k_1", "k_2"} <= both
    found = identified(pair(), START.replace(n=TRUTH["n"]), ("k", "phi", "k_1")).identification
    assert found.misfit > 2.0
    low, high = next(one.refitted["k_1"] for one in found.fixed if one.fixed.name == "k_2")
    assert high < TRUTH["k_1"] < low


def test_the_arc_is_told_where_any_set_measured_the_sinkage():
    first, second = (each.only(DrawbarPull, Torque) for each in pair())
    free, priors = free_unmeasured_modulus((first, second), START, ("k", "phi"), {})
    assert (free, priors["k_1"].mean) == (("k", "phi", "k_1"), 5e4)
    assert free_unmeasured_modulus((first, rig("wide")), START, ("k", "phi"), {}) == (("k", "phi"), {})


# --- one sand --------------------------------------------------------------------------------------------------------


def test_what_any_set_declares_of_the_sand_holds_for_all():
    first = rig("narrow", declared={"n": 1.1}, doubts={"n": 0.1}, beside={"lug_height": 0.005})
    second = rig(
        "wide", declared={"phi": 0.5, "n": 1.1}, doubts={"n": 0.2, "phi": 0.03}, wheel_range={"phi": (0.4, 0.6)}
    )
    third = dataclasses.replace(second, name="third", declared={}, doubts={}, wheel_range={"r": (0.08, 0.1)},
                                beside={"bulk_density": 1500.0, "lug_height": 0.002})  # fmt: skip
    sand = sand_of((first, third, second))
    assert sand.name == "wide", "that declares most"
    assert sand.declared == {"n": 1.1, "phi": 0.5}
    assert sand.doubts == {"n": 0.2, "phi": 0.03}, "its own SD where both state one"
    assert sand.beside == {"bulk_density": 1500.0}, "lugs are a wheel's"
    assert sand.wheel_range == {"phi": (0.4, 0.6)}
    assert sand_of(first) is first
    depth = np.linspace(0.005, 0.02, 9)
    pressed = dataclasses.replace(first, trials=(Trial("1", depth, 1e4 * depth),))
    assert sand_of((pressed, second)).name == "narrow"
    soil = sand_of((pressed, second)).declared_soil(Soil())
    assert (soil.phi, soil.n, soil.k_1) == (0.5, 1.1, pressed.declared_soil(Soil()).k_1)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"declared": {"n": 1.2}}, r"wide: \[soil\] declares n = 1\.2, narrow 1\.1 \[SI\]: one sand has one of it"),
        ({"beside": {"bulk_density": 1600.0}}, "wide: .* bulk_density = 1600, narrow 1500"),
    ],
)
def test_sets_that_declare_different_sands_are_refused(how, said):
    first = rig("narrow", declared={"n": 1.1}, beside={"bulk_density": 1500.0})
    with pytest.raises(DataError, match=said):
        identified((first, rig("wide", **how)), START, ("k",))


def test_sets_in_memory_that_share_a_name_are_refused():
    """Which wheel an `r of wheel rig` is could not be told."""
    first, second = (dataclasses.replace(each, name="wheel rig") for each in pair())
    with pytest.raises(DataError, match="wheel rig: two sets have this name; give each its own, to tell whose numbers"):
        identified((first, second), START, ("k",))


# --- the command -----------------------------------------------------------------------------------------------------


SMOOTH, SKID = DATA / "cmu-smooth-wheel", DATA / "cmu-smooth-wheel-skid"


def run(*words):
    return CliRunner().invoke(app, ["identify", *map(str, words)])


def test_the_command_fits_measured_sets_together(caplog):
    told = run(SMOOTH, SKID, "--free", "phi,k_1", "--json")
    assert told.exit_code == 0, told.output
    assert "cmu-smooth-wheel-skid: 3 of 12 runs are in another set too; they are used once." in caplog.text
    found = json.loads(told.stdout)
    assert [(row["set"], row["points"]) for row in found["channels"]] == [
        ("cmu-smooth-wheel", 15), ("cmu-smooth-wheel", 15), ("cmu-smooth-wheel-skid", 9), ("cmu-smooth-wheel-skid", 9),
    ]  # fmt: skip
    n = next(row for row in found["held"] if row["name"] == "n")
    assert n["source"] == "the same wheel pressed in without turning, 3 trials", "of the set that has them"
    assert [row["name"] for row in found["held"]].count("rig.pull_tare") == 1
    flags = {flag["name"]: flag["source"] for flag in found["elsewhere"]}
    assert flags.keys() == {"phi", "K_eff"}
    assert flags["K_eff"] == "the same wheel pressed in without turning, 3 trials: cmu-smooth-wheel"
    assert flags["phi"].startswith("angle_of_repose")
    assert found["unused"] == ["bulk_density"]


def test_one_folder_is_read_as_ever():
    assert checked_evidence(SMOOTH).evidence.slip.tobytes() == read_evidence(SMOOTH).slip.tobytes()
    sets = checked_evidence((SMOOTH, SKID)).evidence
    joint = read_joint((SMOOTH, SKID))
    assert [each.name for each in sets] == list(joint.sets)


def test_what_is_no_set_of_the_same_sand_is_refused(tmp_path, caplog):
    again = tmp_path / "again"
    again.mkdir()
    text = (SKID / "rig.toml").read_text()
    (again / "points.csv").write_text((SKID / "points.csv").read_text())
    (again / "rig.toml").write_text(text.replace("1330.0", "1500.0").replace("wheel-skid", "wheel-loose"))
    slopes = tmp_path / "slopes"
    slopes.mkdir()
    (slopes / "slope.toml").write_text('kind = "slip-slope"\n')
    stated = tmp_path / "stated"
    stated.mkdir()
    (stated / "points.csv").write_text((SKID / "points.csv").read_text())
    (stated / "rig.toml").write_text(
        text.replace("wheel-skid", "wheel-tared") + '\n[rig]\npull_tare = { value = 0.0, sd = 1.0, unit = "N" }\n'
    )
    for other, said in {
        SMOOTH: "cmu-smooth-wheel: two sets have this name; give each its own in its rig.toml.",
        DATA / "steepening-slope": "there is no rig.toml in it; several data are rig sets in one sand.",
        slopes: "there is no rig.toml in it; several data are rig sets in one sand.",
        DATA / "cmu-smooth-wheel-angles": "cmu-smooth-wheel-angles: 30 of 30 runs have a slip angle; identify fits",
        again: "cmu-smooth-wheel-loose: [soil] declares bulk_density = 1500, cmu-smooth-wheel 1330 [SI]: one sand has",
        stated: "cmu-smooth-wheel-tared: [rig] states errors of the rig, which identify does not fit",
    }.items():
        caplog.clear()
        told = run(SMOOTH, other)
        assert told.exit_code != 0
        assert said in str(told.exception) + told.output + caplog.text, other
    told = run(SMOOTH, DATA / "ding-2011-smooth", "--free", "k,r")
    assert "r and b cannot be free for data of different wheels" in str(told.exception) + told.output
