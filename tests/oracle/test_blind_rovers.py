"""The other rovers of the blind generator (oracle/blind/vehicle): properties that hold for every rover, and a
comparison with the package.

Their equations are those of Nexus 6, which `test_blind_generator` compares with the package.
"""

import importlib
import importlib.util
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.terrain.terrain import Lanes, Profile

HERE = Path(__file__).parent / "blind"
if "blind_pair" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("blind_pair", HERE.with_name("blind_pair.py"))
    sys.modules["blind_pair"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["blind_pair"])
pair = sys.modules["blind_pair"]
drive, hidden, rover, sealed, soil, vehicle, world = (
    importlib.import_module(f"blind.{name}")
    for name in ("drive", "hidden", "rover", "sealed", "soil", "vehicle", "world")
)

G = 9.81


def cruise_resistance(sand, slip=0.05):
    """Return torque / (r f_n) at the fixed angles, which is the resistance at which a rover cruises on level ground at
    this slip.
    """
    on = soil.arc(np.array([sand["theta_1"]]), np.array([sand["theta_2"]]))
    numbers = {"c": sand["c"], "tan_phi": np.tan(sand["phi"]), "k": sand["k"], "K": sand["k_1"], "n": None}
    f_n, torque = soil.forces(on, soil.travel_ratio(np.array([slip])), numbers, sand["r"], sand["b"])
    return float(torque[0] / (sand["r"] * f_n[0]))


R = cruise_resistance(world.PLAIN)
"""With which Nexus 6 cruises the flat at a slip of 0.05, and so whatever is in proportion to it."""
OTHERS = ("heavy", "cart")
BUILT = {
    "heavy": {"mass": 7 * 2.9 + 5 * 2.9, "ahead": None, "r": 0.0675, "b": 0.075, "wheels": 6},
    "cart": {"mass": 8.0 + 4 * 0.5, "ahead": -0.02 * 8.0 / 10.0, "r": 0.06, "b": 0.06, "wheels": 4},
}
"""Of each rover [kg, m]: what the centre of mass is ahead of the base's origin by, where symmetry does not say it."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Return a set of half a second of either rover without a hidden effect."""
    folder = tmp_path_factory.mktemp("rovers")
    sets = [{"index": at, "kind": "none", "hidden": [], "under": name} for at, name in enumerate(OTHERS, 2)]
    sealed.generate(folder / "sets", sets, 4, folder / "answers.json", duration=0.5)
    return {name: folder / "sets" / f"set_{at:04d}" for at, name in enumerate(OTHERS, 2)}


def nominal(of):
    """Return the numbers of a run of a rover on the sand and with the motors that are in proportion to it."""
    plain = world.PLAIN
    soil = {"k": plain["k"] * of.ratio("length"), "k_1": plain["k_1"] * of.ratio("Pa")}
    motor = {"constant": plain["constant"] * of.ratio("length"), "resistance": plain["resistance"] * of.ratio("ohm")}
    return of.base(plain) | soil | motor | {"rest": 0.001, "rest_q": 1.0}


def flat_run(of, R, rows=161):
    level = (np.array([-3.0, 3.0]), np.zeros(2))
    duty, steer = of.commands(np.full((rows, 6), 0.55), np.zeros((rows, 4)))
    return world.Run(nominal(of) | {"R": R}, (level,), (), (0.0, 0.0, 0.0), duty, steer, (1.0,) * len(of.wheels))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_it_is_built_as_it_says(logs, name):
    root = ElementTree.parse(logs[name] / f"{name}.urdf").getroot()
    built, declared = BUILT[name], tomllib.loads((logs[name] / f"{name}.toml").read_text())
    assert sum(float(element.get("value")) for element in root.iter("mass")) == pytest.approx(built["mass"])
    assert {key: declared["wheel"][key]["value"] for key in "rb"} == pytest.approx({key: built[key] for key in "rb"})
    theirs = read_drive_log(logs[name]).load_rover()
    assert theirs.mass == pytest.approx(built["mass"])
    assert [mount.name for mount in theirs.wheels] == list(vehicle.KNOWN[name].wheels)
    assert len(theirs.wheels) == built["wheels"]
    of = vehicle.KNOWN[name]
    share = built["mass"] / built["wheels"] / (5.8 / 6)
    assert (of.mass, of.load) == pytest.approx((built["mass"] / 5.8, share))
    assert (of.length, of.width) == pytest.approx((built["r"] / 0.045, built["b"] / 0.05))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_at_rest_the_ground_carries_its_weight(name):
    """The forces sum to m g upwards, and their moment about the base's origin equals the moment of the weight."""
    of, built = vehicle.KNOWN[name], BUILT[name]
    rovers = rover.Rovers([flat_run(of, R)], of)
    state = drive.rest(rovers)
    pose = rovers.pose(state, np.zeros((len(of.steered), 1)), 0.0025, braked=True)
    u, along, across, dug, *_ = np.split(state.fast, rovers.cuts)
    total, _ = rovers.soil(u, along, across, dug, pose)
    weight = built["mass"] * G
    assert total[:3, 0] == pytest.approx([0.0, 0.0, weight], abs=2e-4 * weight)
    if built["ahead"] is not None:
        assert total[3:6, 0] == pytest.approx([0.0, -built["ahead"] * weight, 0.0], abs=5e-4 * weight)


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_on_the_flat_its_motors_give_what_the_resistance_takes(name):
    """At a speed near 0.05 m/s and S = 0.05, v = (1 - S) r omega, and the torques of all wheels divided by r sum to R m
    g.
    """
    of, built = vehicle.KNOWN[name], BUILT[name]
    trace = drive.drive([flat_run(of, R)], 8.0, vehicle=of)
    last = {key: values[0, -60:] for key, values in trace.items()}
    rim = np.array([built["r"] * last[f"wheel_rate_{wheel}"] for wheel in of.wheels])
    slip = np.array([last[f"slip_{wheel}"] for wheel in of.wheels])
    assert last["body_vx"] == pytest.approx(((1.0 - slip) * rim).mean(axis=0), rel=5e-3)
    assert 0.04 < last["body_vx"].mean() < 0.05
    assert slip.mean() == pytest.approx(0.05, abs=0.005)
    current = np.array([last[f"current_{wheel}_A"] for wheel in of.wheels])
    constant = world.PLAIN["constant"] * built["r"] / 0.045
    assert constant * current.sum(axis=0).mean() / built["r"] == pytest.approx(R * built["mass"] * G, rel=0.01)
    spent = 7.2 * 0.55 * current.sum() - world.PLAIN["resistance"] / of.load * (current**2).sum()
    turned = constant * (current * rim / built["r"]).sum()
    assert spent == pytest.approx(turned, rel=2e-3)


def driven(logs, name, effect, values, duration, tracks):
    """Drive tracks with the generator and with the package, as the log declares them, with one effect."""
    of, models, runs = vehicle.KNOWN[name], [], []
    base = base_model(read_drive_log(logs[name]))
    base = base.having(base.effect(MotionResistance).replace(q=0.0))  # as the generator's fades, which no log tells
    soil = base.soils[0]
    soil_numbers = {"R": float(base.effect(MotionResistance).R), "phi": soil.phi, "k": soil.k, "k_1": soil.k_1}
    for lanes, borders, start, *commands in tracks:
        model = base.replace(terrain=Lanes(tuple(Profile(*lane) for lane in lanes), borders))
        models.append(model if effect is None else model.having(effect(**{**effect.neutral, **values})))
        numbers = {} if effect is None else {f"{effect.__name__}.{key}": value for key, value in values.items()}
        gains = (1.0,) * len(of.wheels)
        runs.append(
            world.Run(nominal(of) | soil_numbers | numbers, lanes, borders, start, *of.commands(*commands), gains)
        )
    return pair.both(models, runs, duration, of=of), of


def limits(of):
    """Return the limits. The limit of currents scales with the sensors' noise."""
    return pair.LIMITS | {"current": pair.LIMITS["current"] * of.load}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_it_drives_as_the_package_does(logs, name):
    ours, of = driven(logs, name, None, {}, 1.5, pair.tracks()[1:3])
    for mine, theirs in ours:
        pair.assert_alike(mine, theirs, limits(of), of)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("cart", MultiPass),
        ("heavy", PivotFriction),
        pytest.param("heavy", None, marks=pytest.mark.nightly),
        pytest.param("cart", None, marks=pytest.mark.nightly),
        pytest.param("heavy", GearFriction, marks=pytest.mark.nightly),
    ],
)
def test_it_drives_as_the_package_does_for_long(logs, name, effect):
    """The drive goes over the ramp with a reversal, at which the axles change their order, and over waves with
    steering.

    The limit is a third of the noise, because a cart turns by the difference of its sides, and its heading sums this
    difference for 14 s.
    """
    kind = "none" if effect is None else effect.__name__
    drawn = {} if effect is None else hidden.ALL[kind](np.random.default_rng(3), 4.0)
    values = vehicle.KNOWN[name].sized(kind, drawn)
    ours, of = driven(logs, name, effect, values, 14.0, pair.tracks()[1:3])
    for mine, theirs in ours:
        pair.assert_alike(mine, theirs, limits(of) | {"place": 1.5e-3, "angle": 1e-3}, of)


def test_what_is_hidden_has_the_size_of_the_rover():
    """A torque scales with the weight on a wheel times its radius, a pull with the mass, and a length with
    the radius.
    """
    heavy = vehicle.HEAVY
    assert heavy.sized("GearFriction", {"tau_c": 0.01}) == {"tau_c": pytest.approx(0.01 * 6.0 * 1.5)}
    assert heavy.sized("TetherDrag", {"f_0": 0.1, "f_1": 0.2}) == pytest.approx({"f_0": 0.6, "f_1": 1.2})
    assert heavy.sized("PointMass", {"shift_x": 0.01}) == {"shift_x": pytest.approx(0.015)}
    assert heavy.sized("SupplySag", {"R_b": 0.6, "tau": 0.1}) == pytest.approx({"R_b": 0.1, "tau": 0.1})
    assert heavy.sized("SlipSinkage", {"n_1": 0.1}) == {"n_1": 0.1}
    named = {
        f"{name}.{key}"
        for name, draw in hidden.ALL.items()
        for s in range(40)
        for key in draw(np.random.default_rng(s), 2.0)
    }
    assert set(vehicle.SIZED) <= named
    for name in hidden.ALL:
        drawn = hidden.ALL[name](np.random.default_rng(1), 3.0)
        assert vehicle.NEXUS6.sized(name, drawn) == drawn
