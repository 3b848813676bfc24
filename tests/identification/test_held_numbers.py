"""What a fit holds, where that is from, and what moves when it moves: against refits, on made sets of a known truth."""

import dataclasses
import json
import math
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import DataError, OptimisationError
from rover_pin.cli.app import app
from rover_pin.cli.terminal import json_text
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.problem import Prior
from rover_pin.experiments.drive_log.model import SOIL_SD, UNDECLARED
from rover_pin.experiments.wheel_rig.data import as_rig_set, read_rig_set
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.identification import dependence
from rover_pin.identification.dependence import _blamed, with_held
from rover_pin.identification.held import ASSUMED_SDS, held_numbers
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.result import Assumed, Held, Verdict, describe_dependence
from rover_pin.loop.identified import identified
from rover_pin.measurements.channel import FIELDS, DrawbarPull, Sinkage, Torque
from rover_pin.measurements.known import declared_ranges
from rover_pin.measurements.pressed import EXPONENTS, exponent, press
from rover_pin.measurements.reading import read_evidence
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.soil.traction import load_traction_factor

DATA = Path(__file__).parents[2] / "studies" / "data"
WHEEL = Wheel(r=0.06, b=0.05)
TRUTH = Soil(c=0.0, phi=math.radians(32.0), k=0.008, k_1=6e4, k_2=0.0, n=1.0)
ONE = Search(starts=1)
KINDS = (DrawbarPull, Torque)


def rig(kinds=KINDS, sd=0.002, **how):
    """Return what the law says of TRUTH at two loads, with exact readings and a small stated noise."""
    slip, load = np.tile(np.linspace(0.02, 0.8, 6), 2), np.repeat([10.0, 25.0], 6)
    blank = WheelRig(WHEEL, slip, load, tuple(kind(np.full(12, 1e-3), 1.0) for kind in kinds))
    fields = np.array([float({**WHEEL.values(), **TRUTH.values()}[name]) for name in FIELDS])
    values = blank.predictor(("k",))(fields)[0].reshape(len(kinds), 12)
    channels = tuple(kind(row, sd * max(np.abs(row))) for kind, row in zip(kinds, values, strict=True))
    return dataclasses.replace(blank, channels=channels, **how)


def points(sd=0.003, soil=Soil(k=0.005), **how):
    slip = np.linspace(0.05, 0.8, 10)
    return TractionPoints(slip, [float(load_traction_factor(S, soil, Wheel())) for S in slip], sd, **how)


def judged(data, soil, free, priors=None, said=None):
    found = identify(data, soil, free, priors, ONE)
    return with_held(found, data, held_numbers(data, soil, free, said), priors)


# --- the list --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("free", [("k", "phi"), ("k", "phi", "k_1"), ("phi", "r", "n", "k_2"), FIELDS])
@pytest.mark.parametrize("k_2", [0.0, 1e5])
def test_every_number_is_free_or_held_once(free, k_2):
    names = [one.name for one in held_numbers(rig(), TRUTH.replace(k_2=k_2), free)]
    both = not {"k_1", "k_2"} & set(free)
    told = {"k_1", "k_2"} if both else set()
    assert sorted(names) == sorted(
        [name for name in FIELDS if name not in free and name not in told]
        + (["k_1 + k_2 b" if k_2 else "k_1"] if both else [])
    )


def row(name, data, soil=TRUTH, free=("k", "phi"), said=None):
    return next(one for one in held_numbers(data, soil, free, said) if one.name == name)


def test_each_says_where_it_is_from():
    declared = rig(declared={"n": 1.0, "c": 0.0})
    assert row("n", declared).source == "declared with the data"
    assert row("n", declared, TRUTH.replace(n=1.2)).source == "as given"
    assert row("n", declared, said={"n": "--set"}).source == "--set"
    assert row("exit_ratio", declared).source == "paper, Table 1: 5/35"
    assert row("r", declared).source == "declared with the data"
    assert row("r", points()).source == "paper, section 2: diameter 0.09 m"
    assert row("k_1 + k_2 b", rig(declared={"k_c": 0.0, "k_phi": 1.2e6}), TRUTH.replace(k_1=0.0, k_2=1.2e6)).source == (
        "declared with the data"
    )
    assert row("k_1 + k_2 b", rig(), TRUTH.replace(k_2=2e5), said={"k_2": "--set"}).source == "--set"
    alone = row("k_2", rig(), free=("k", "k_1"))
    assert (alone.low, alone.high, alone.doubt) == (0.0, 0.0, "the other stands for k_1 + k_2 b")


@pytest.mark.parametrize(
    ("how", "said", "sd", "doubt"),
    [
        ({}, {}, 0.3, "assumed of another soil's"),
        ({"declared": {"n": 1.0}}, {}, 0.1, "assumed of one stated without an SD"),
        ({"declared": {"n": 1.0}, "doubts": {"n": 0.02}}, {}, 0.02, "its declared SD"),
        ({}, {"n": "--set"}, 0.1, "assumed of one stated without an SD"),
        ({"declared": {"n": 1.3}, "doubts": {"n": 0.02}}, {}, 0.3, "assumed of another soil's"),
    ],
)
def test_a_range_is_that_of_whoever_stated_the_number(how, said, sd, doubt):
    found = row("n", rig(**how), said=said)
    assert (found.low, found.high) == pytest.approx((1.0 - 1.959964 * sd, 1.0 + 1.959964 * sd))
    assert found.doubt == doubt
    assert found.ends == ({"n": found.low}, {"n": found.high})


def test_held_range_stays_in_bounds_and_modulus_is_by_factor():
    assert row("c", rig()).low == 0.0
    assert row("c", rig()).high == pytest.approx(1.959964 * 300.0)
    stated = row("c", rig(declared={"c": 400.0}), TRUTH.replace(c=400.0))
    assert stated.high == pytest.approx(400.0 * (1 + 1.959964 * 0.35))
    pressure = row("k_1", rig())
    assert (
        pressure.high / pressure.value == pytest.approx(pressure.value / pressure.low) == pytest.approx(3.94, abs=0.01)
    )
    known = rig(declared={"k_1": 6e4}, doubts={"k_1": 6e3})
    assert row("k_1", known).high == pytest.approx(6e4 * math.exp(0.1959964))
    shared = row("k_1 + k_2 b", rig(), TRUTH.replace(k_1=1e4, k_2=1e6))
    assert shared.value == pytest.approx(6e4)
    assert [end["k_1"] + 5e4 for end in shared.ends] == pytest.approx([shared.low, shared.high])


def test_what_nobody_states_is_as_unsure_as_in_the_loops():
    for name, sd in SOIL_SD.items():
        assert (ASSUMED_SDS[name].declared, ASSUMED_SDS[name].otherwise) == pytest.approx((sd, UNDECLARED * sd))
    free = RigExperiment(as_rig_set(rig())).uncertain(RigModel(WHEEL, TRUTH))
    scales = {one.name.removeprefix("soil."): one.scale for one in free if one.prior}
    assert {"n", "c", "exit_ratio"} <= set(scales)
    assert all(ASSUMED_SDS[name].otherwise == pytest.approx(sd) for name, sd in scales.items())


@pytest.mark.parametrize(
    ("ranges", "sds", "ends", "doubt"),
    [
        ({}, {}, (0.06 * (1 - 0.01959964), 0.06 * (1 + 0.01959964)), "assumed of one stated without an SD"),
        ({"r": (0.058, 0.0601)}, {}, (0.058, 0.0601), "its declared range"),
        ({}, {"r": 1e-3}, (0.06 - 1.959964e-3, 0.06 + 1.959964e-3), "its declared SD"),
        ({"r": (0.0590, 0.0601)}, {"r": 1e-3}, (0.0590, 0.0601), "its declared SD"),
    ],
)
def test_sizes_of_the_wheel_have_the_range_that_the_set_states(ranges, sds, ends, doubt):
    found = declared_ranges(WHEEL.values(), ranges, sds)["r"]
    assert (found.low, found.high) == pytest.approx(ends)
    assert found.range_source == doubt


def set_with(folder, soil):
    """Return a copy of a measured set with another table [soil]."""
    copytree(DATA / "ding-2011-smooth", folder)
    path = folder / "rig.toml"
    head, _, rest = path.read_text(encoding="utf-8").partition("[soil]")
    path.write_text(f"{head}[soil]\n{soil}\n[noise]{rest.partition('[noise]')[2]}", encoding="utf-8")
    return folder


def test_a_constant_of_the_soil_may_state_its_range(tmp_path):
    phi = 'phi = { value = 30.0, unit = "deg", low = 28.0, high = 33.0 }'
    soil = phi + "\nn = { value = 1.0, sd = 0.1, low = 0.9, high = 2.0 }"
    data = read_evidence(set_with(tmp_path / "set", soil))
    own = data.declared_soil(Soil())
    phi, n = row("phi", data, own, ("k",)), row("n", data, own, ("k",))
    assert (phi.low, phi.high) == pytest.approx((math.radians(28.0), math.radians(33.0)))
    assert (phi.doubt, phi.source) == ("its declared range", "declared with the data")
    assert (n.low, n.high) == pytest.approx((0.9, 1.1959964))


@pytest.mark.parametrize("ends", ["low = 31.0, high = 33.0", "low = 33.0, high = 28.0"])
def test_a_range_that_leaves_its_value_out_is_refused(tmp_path, ends):
    folder = set_with(tmp_path / "set", f'phi = {{ value = 30.0, unit = "deg", {ends} }}')
    with pytest.raises(DataError, match=r"phi = 0\.5236 is not between its low = .* and high = .* \[SI\]"):
        read_evidence(folder)


# --- what moves ------------------------------------------------------------------------------------------------------


def refitted(data, soil, free, change):
    """Return the fit from scratch of a set and a soil that were changed by hand."""
    sizes = {name: value for name, value in change.items() if name in ("r", "b")}
    own = dataclasses.replace(data, wheel=data.wheel.replace(**sizes))
    soil = soil.replace(**{name: value for name, value in change.items() if name not in sizes})
    return {one.name: one for one in identify(own, soil, free, search=Search(starts=3)).estimates}, soil


@pytest.mark.parametrize(
    ("data", "soil", "free"),
    [
        (rig(), TRUTH, ("k", "phi")),
        (rig((*KINDS, Sinkage)), TRUTH.replace(n=1.1), ("k", "phi", "k_1")),
        (points(), Soil(), ("k", "phi")),
    ],
    ids=["rig", "rig with sinkage", "traction points"],
)
def test_moves_are_those_of_refits_from_scratch(data, soil, free):
    moving = 0
    for one in judged(data, soil, free).fixed:
        if not one.refitted:
            continue
        for side, change in enumerate(one.fixed.ends):
            fresh, _ = refitted(data, soil, free, change)
            for name in free:
                width = fresh[name].high - fresh[name].low
                assert one.refitted[name][side] == pytest.approx(fresh[name].value, abs=0.02 * width, nan_ok=True), (
                    one.fixed.name,
                    name,
                )
                moving += 1
    assert moving >= 4 * len(free)


def test_what_does_not_enter_the_data_moves_nothing():
    found = {one.fixed.name: one for one in judged(rig(), TRUTH, ("k", "phi")).fixed}
    assert not found["theta_1"].refitted
    assert not found["theta_2"].refitted
    assert "does not enter these data" in found["theta_1"].line({})
    fixed = {one.fixed.name: one for one in judged(points(), Soil(), ("k", "phi")).fixed}
    assert not fixed["exit_ratio"].refitted
    assert fixed["theta_1"].refitted


def test_a_modulus_held_at_twice_the_truth_is_blamed():
    """k_1 twice too high fits well, and phi's interval excludes the truth: it was `found`."""
    known = {name: float(getattr(TRUTH, name)) for name in ("c", "n", "exit_ratio")}
    data = rig(declared=known, doubts={"c": 5.0, "n": 0.005, "exit_ratio": 0.005})
    wrong = TRUTH.replace(k_1=2.0 * TRUTH.k_1)
    bare = identify(data, wrong, ("k", "phi"), search=ONE)
    assert bare["phi"].verdict is Verdict.FOUND
    assert not bare["phi"].low < TRUTH.phi < bare["phi"].high
    found = judged(data, wrong, ("k", "phi"))
    for name in ("k", "phi"):
        one = found[name]
        assert one.verdict is Verdict.DEPENDS
        assert one.depends_on[0] == "k_1"
        assert one.verdict_text.startswith("depends on the assumed k_1")
        assert one.reason.startswith("depends on the assumed k_1 (it becomes ")
        assert "sinkage under a known load tells k_1 + k_2 b" in one.reason
        assert (one.value, one.low, one.high) == (bare[name].value, bare[name].low, bare[name].high)
        moved = next(each for each in found.fixed if each.fixed.name == "k_1").refitted[name]
        assert min(moved) < float(getattr(TRUTH, name)) < max(moved)
        assert name not in found.identified


def test_what_was_measured_is_not_called_assumed():
    """The same modulus, declared with the SD of a coarse measurement: it decides as well, and nobody assumed it."""
    wrong = TRUTH.replace(k_1=2.0 * TRUTH.k_1)
    known = {name: float(getattr(wrong, name)) for name in ("c", "n", "exit_ratio", "k_1")}
    sds = {"c": 5.0, "n": 0.005, "exit_ratio": 0.005, "k_1": 0.35 * wrong.k_1}
    found = judged(rig(declared=known, doubts=sds), wrong, ("k", "phi"))
    one = found["phi"]
    assert one.verdict is Verdict.DEPENDS
    assert one.measured == one.depends_on[:1] == ("k_1",)
    assert one.verdict_text == "depends on the measured k_1"
    assert one.reason.startswith("depends on the measured k_1 (it becomes ")
    assert "): it was measured, but not closely enough; sinkage under a known load tells" in one.reason


def test_what_a_number_depends_on_is_told_by_kind():
    words = {"exit_ratio": "exit_ratio (a)", "n": "n (b)", "c": "c (c)"}
    assert describe_dependence(words, ("n",)) == "the assumed exit_ratio (a) and c (c) and the measured n (b)"
    assert describe_dependence(words, ()) == "the assumed exit_ratio (a) and n (b) and c (c)"
    assert describe_dependence({"n": "n"}, ("n",)) == "the measured n"


def sure(value):
    return Held(
        "k_1",
        "Pa",
        value,
        "made",
        0.999 * value,
        1.001 * value,
        "made",
        ({"k_1": 0.999 * value}, {"k_1": 1.001 * value}),
    )


def test_number_held_precisely_enough_lets_another_be_found():
    data, wrong = rig(), TRUTH.replace(k_1=2.0 * TRUTH.k_1)
    found = with_held(identify(data, wrong, ("k", "phi"), search=ONE), data, [sure(2.0 * TRUTH.k_1)])
    assert found["phi"].verdict is Verdict.FOUND
    assert found["phi"].depends_on == ()


def test_a_prior_and_a_misfit_are_in_the_refits_too():
    """With a prior as tight as a pin, nothing moves the number that has it."""
    data = rig()
    tight = {"phi": Prior(float(TRUTH.phi), 1e-7)}
    found = judged(data, TRUTH, ("k", "phi"), tight)
    assert found["phi"].verdict is Verdict.HELD_AT_PRIOR
    for one in found.fixed:
        if one.refitted:
            assert one.refitted["phi"] == pytest.approx((TRUTH.phi, TRUTH.phi), abs=1e-5)


@pytest.mark.parametrize(
    ("far", "blamed"),
    [
        ({"a": 0.5, "b": 0.5}, []),
        ({"a": 1.1, "b": 0.2, "c": 3.0}, ["c", "a"]),
        ({"a": 0.8, "b": 0.1, "c": 0.7}, ["a", "c"]),
        ({"a": 0.6, "b": 0.6, "c": 0.6}, ["a", "b", "c"]),
        ({"a": math.inf}, ["a"]),
        ({}, []),
    ],
)
def test_number_or_fewest_numbers_with_a_large_shift_are_blamed(far, blamed):
    assert _blamed(far) == blamed


def test_several_that_move_a_number_together_are_said_to():
    data, soil = rig(), TRUTH
    first = identify(data, soil, ("phi",), search=ONE)
    half = 0.5 * (first["phi"].high - first["phi"].low)

    def slope(name, step):
        up = identify(data, soil.replace(**{name: getattr(soil, name) + step}), ("phi",), search=ONE)["phi"].value
        return (up - first["phi"].value) / step

    rows = []
    for name, step in (("n", 1e-3), ("exit_ratio", 1e-3)):
        far, value = abs(0.8 * half / slope(name, step)), float(getattr(soil, name))
        ends = ({name: value - far}, {name: value + far})
        rows.append(Held(name, "", value, "made", value - far, value + far, "made", ends))
    for held, verdict in ((rows[:1], Verdict.FOUND), (rows[1:], Verdict.FOUND), (rows, Verdict.DEPENDS)):
        found = with_held(first, data, held)["phi"]
        assert found.verdict is verdict
        assert found.reason.count(" together: ") == (verdict is Verdict.DEPENDS)


def test_an_end_at_which_nothing_fits_is_said_and_blamed(monkeypatch):
    """What cannot be followed to its end is not taken for what does not move."""
    data, whole = rig(), dependence.descend

    def lost(problem, u):
        if problem.space.base[problem.space.all_names.index("k_1")] < 1e4:
            raise OptimisationError("the model has no finite value where the descent starts; start elsewhere.")
        return whole(problem, u)

    monkeypatch.setattr(dependence, "descend", lost)
    soft = Held("k_1", "Pa", 6e4, "made", 5e3, 6e4, "made", ({"k_1": 5e3}, {"k_1": 6e4}))
    found = with_held(identify(data, TRUTH, ("phi",), search=ONE), data, [soft])
    assert math.isnan(found.fixed[0].refitted["phi"][0])
    assert found.fixed[0].refitted["phi"][1] == pytest.approx(TRUTH.phi, rel=1e-4)
    assert found["phi"].verdict is Verdict.DEPENDS
    assert "it becomes no fit to 32 deg" in found["phi"].reason
    assert json.loads(json_text(found.as_dict()))["held"][0]["moves"]["phi"][0] is None


# --- what is said ----------------------------------------------------------------------------------------------------


def test_a_line_has_value_source_range_and_moves():
    held = Held("theta_1", "rad", math.radians(35.0), "Table 1", math.radians(30.0), math.radians(40.0), "guessed")
    assert Assumed(held, {"k": (0.001, 0.002), "phi": (0.5, math.nan)}).line({"k": "m", "phi": "rad"}) == (
        "theta_1 = 35 deg (Table 1), 30 to 40 deg (guessed): k 0.001 to 0.002 m; phi 28.65 to no fit deg"
    )
    still = Held("k_2", "Pa/m", 0.0, "Table 1", 0.0, 0.0, "no matter")
    assert Assumed(still, {}).line({}) == "k_2 = 0 Pa/m (Table 1): no matter"


def test_text_and_json_say_the_same():
    found = judged(rig(), TRUTH.replace(k_1=1.2e5), ("k", "phi"))
    told, text = found.as_dict(), found.report()
    assert [row["name"] for row in told["held"]] == [one.fixed.name for one in found.fixed]
    assert all(f"  {row['name']} = " in text and row["source"] in text for row in told["held"])
    assert told["parameters"]["phi"]["verdict"] == found["phi"].verdict_text
    assert told["parameters"]["phi"]["depends_on"] == list(found["phi"].depends_on)
    assert found["phi"].reason in text
    moved = next(row for row in told["held"] if row["name"] == "k_1")["moves"]["phi"]
    assert f"phi {math.degrees(moved[0]):.4g} to {math.degrees(moved[1]):.4g} deg" in text


def command(*words):
    told = CliRunner().invoke(app, ["identify", *words])
    assert told.exit_code == 0, told.output
    return told.stdout


# --- pressed in ------------------------------------------------------------------------------------------------------


def test_pressed_wheel_gives_n_and_k_1_as_in_the_loop():
    data, loop = read_evidence(DATA / "cmu-smooth-wheel"), read_rig_set(DATA / "cmu-smooth-wheel")
    assert len(data.trials) == 3
    soil = data.declared_soil(Soil())
    assert soil == loop.soil()
    n, b = exponent(data.trials, data.wheel), data.wheel.b
    moduli = press(data.trials, data.wheel, n).moduli * b**n
    assert (soil.n, soil.k_1, soil.k_2) == pytest.approx((n, moduli.mean(), 0.0))
    pressed = row("k_1", data, soil)
    assert pressed.source == "the same wheel pressed in without turning, 3 trials"
    assert (pressed.low, pressed.high) == pytest.approx((0.9 * moduli.min(), 1.1 * moduli.max()))
    along = row("n", data, soil)
    assert EXPONENTS[0] < along.low < n < along.high < EXPONENTS[1]
    for end in along.ends:
        assert end["k_1"] == pytest.approx(press(data.trials, data.wheel, end["n"]).mean * b ** end["n"])


def test_a_stated_exponent_holds_when_the_wheel_was_pressed_in():
    data = dataclasses.replace(read_evidence(DATA / "cmu-smooth-wheel"), declared={"n": 1.2})
    soil = data.declared_soil(Soil())
    assert soil.n == 1.2
    assert soil.k_1 == pytest.approx(press(data.trials, data.wheel, 1.2).mean * data.wheel.b**1.2)
    assert row("n", data, soil).source == "declared with the data"
    assert row("k_1", data, soil).source.startswith("the same wheel pressed in")


def test_a_soil_of_ones_own_is_not_said_to_be_the_pressed_one():
    data = read_evidence(DATA / "cmu-smooth-wheel")
    assert row("k_1", data, Soil()).source == "assumed: Eq 6 at Table 1, S = 0 carries 5.8 kg x 9.81 / 6"
    assert row("n", data, Soil()).doubt == "assumed of another soil's"


# --- measured sets ---------------------------------------------------------------------------------------------------


def test_the_smooth_wheel_says_what_its_sand_was_pressed_to():
    data = read_evidence(DATA / "cmu-smooth-wheel")
    found = identified(data, data.declared_soil(Soil()), ("k", "phi", "k_1"))
    assert not found.identification.identified, "exit ratio, c and n are nobody's measurement"
    flag = next(one for one in found.elsewhere if one.name == "K_eff")
    assert not flag.agrees, "rolling, the sand carries half of what it carried when the wheel was pressed in"
    assert flag.sentence in found.report()
    assert found.as_dict()["elsewhere"][0]["source"] == flag.independent.source


def test_what_a_rig_may_add_to_its_readings_is_listed_by_channel():
    rows = {
        one.fixed.name: one for one in identified(rig((DrawbarPull, Sinkage)), TRUTH, ("k", "k_1")).identification.fixed
    }
    assert [name for name in rows if name.startswith("rig.")] == [
        "rig.load_scale", "rig.pull_tare", "rig.crosstalk", "rig.force_scale", "rig.sinkage_zero",
    ]  # fmt: skip
    assert rows["rig.load_scale"].line({}) == (
        "rig.load_scale = 1 (load over that stated: 1): exact: with an sd in [rig], close-loop fits it"
    )
    assert "rig.torque_tare" in [one.fixed.name for one in identified(rig(), TRUTH, ("phi",)).identification.fixed]


def test_a_drives_k_hangs_on_its_angle_and_its_phi_does_not():
    """j of Eq (2) grows with theta_1 at large slips, with its cube at none; a fit holds j / k."""
    data = read_evidence(DATA / "steepening-slope")
    found = identified(data, data.declared_soil(Soil()), ("k", "phi"))
    assert found.identification["k"].depends_on == ("theta_1",)
    assert found.identification["phi"].verdict is Verdict.FOUND
    assert found.elsewhere == ()
    angle = next(one for one in found.identification.fixed if one.fixed.name == "theta_1")
    low, high = angle.refitted["k"]
    assert low < 0.0015 < high
    wider = angle.fixed.high / angle.fixed.low
    assert wider < high / low < wider**3


def test_the_command_prints_both():
    words = (str(DATA / "ding-2011-smooth"), "--free", "phi", "--set", "soil.n=1.2")
    text, told = command(*words), json.loads(command(*words, "--json"))
    assert told["parameters"]["phi"]["verdict"].startswith("depends on the assumed k")
    assert "n = 1.2 (--set)" in text
    assert next(row for row in told["held"] if row["name"] == "n")["source"] == "--set"
    assert [row["name"] for row in told["elsewhere"]] == ["phi"]
    assert "measured elsewhere: phi = " in text
