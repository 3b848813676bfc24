"""The blind generator (oracle/blind) is compared with the package, its sets are read by the package, and its seal is
checked.

Both simulators contain equal laws, written twice. Without a hidden effect and with every hidden effect, their motions
must agree to a fifth of the sensors' noise (LIMITS), at the usual steps of both. Over whole runs without a hidden
effect, the measured differences are 0.17 mm, 0.2 mrad and 0.5 mrad/s RMS of the wheel rates; they are halved with the
package's step.
"""

import ast
import hashlib
import importlib
import importlib.util
import json
import re
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import Timing
from rover_pin.terrain.terrain import Lanes, Profile

HERE = Path(__file__).parent / "blind"
if "blind_pair" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("blind_pair", HERE.with_name("blind_pair.py"))
    sys.modules["blind_pair"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["blind_pair"])
pair = sys.modules["blind_pair"]
tracks, assert_alike = pair.tracks, pair.assert_alike
campaign, circumstance, hidden, sealed, sensors, world = (
    importlib.import_module(f"blind.{name}")
    for name in ("campaign", "circumstance", "hidden", "sealed", "sensors", "world")
)

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
SEVERITY = 4.0
RESISTANCE = float(
    scenario("flat", soil="table-1", **{"soil.k": 0.005, "cruise_slip": 0.05}).model.effect(MotionResistance).R
)
BASE = scenario("flat", soil="table-1", **{"soil.k": 0.005}).model
SKIDDING = 0.02
"""A resistance below F(0): driven wheels brake on the flat."""


def effect_class(name):
    module = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
    return getattr(importlib.import_module(f"rover_pin.effects.{module}"), name)


def numbers_of(name):
    """Return the numbers of an effect at SEVERITY."""
    if name == "none":
        return {}
    drawn = hidden.ALL[name](np.random.default_rng(3), SEVERITY)
    return drawn | {"x_from": -0.4, "length": 0.3} if name == "HardPatch" else drawn


def with_effect(name, resistance):
    """Return the package's model with this effect alone; all other effects have their neutral values.

    The motion resistance fades below the travel speed v_0, whatever the speed of the rim, as in the generator.
    """
    base = BASE.having(MotionResistance(R=resistance, q=0.0))
    if name == "none":
        return base
    kind, numbers = effect_class(name), numbers_of(name)
    if name == "MotionResistance":
        return base.having(kind(R=resistance + numbers["R"], q=0.0))
    return base.having(kind(**{**kind.neutral, **numbers}))


def both(cases, duration, timing=Timing(), gravity=9.81, resistance=RESISTANCE):
    """Drive cases (effect name, track) with the generator and with the package."""
    models, runs = [], []
    for name, (lanes, borders, start, duty, steer) in cases:
        ground = Lanes(tuple(Profile(*lane) for lane in lanes), borders)
        models.append(with_effect(name, resistance).replace(terrain=ground, gravity=gravity))
        numbers = {"R": resistance, "gravity": gravity, "rest": 0.001, "rest_q": 1.0} | {
            f"{name}.{key}": value for key, value in numbers_of(name).items()
        }
        runs.append(world.Run(numbers, lanes, borders, start, duty, steer))
    return pair.both(models, runs, duration, timing)


def test_it_imports_nothing_of_the_package():
    files = list(HERE.glob("*.py"))
    assert len(files) > 10
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [name.name for name in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            allowed = {*sys.stdlib_module_names, "numpy", "scipy", "blind", ""}
            assert all(name.split(".")[0] in allowed or node.level for name in names)


@pytest.mark.parametrize(
    ("effect", "ways", "duration", "resistance"),
    [
        ("none", slice(1, 3), 1.5, RESISTANCE),
        pytest.param("none", slice(None), 20.0, RESISTANCE, marks=pytest.mark.nightly),
        pytest.param("none", slice(None), 20.0, SKIDDING, marks=pytest.mark.nightly),
        pytest.param("DifferentialCompliance", slice(1, 3), 6.0, RESISTANCE, marks=pytest.mark.slow),
    ],
    ids=["in short", "a whole run", "a run that skids", "a soft differential"],
)
def test_it_drives_as_the_package_does(effect, ways, duration, resistance):
    """The package takes half its step. With its whole step, rockers on a soft differential would differ by 0.8 mrad, a
    quarter above the limit.
    """
    cases = [(effect, track) for track in tracks()[ways]]
    for mine, theirs in both(cases, duration, Timing(dt=0.005), resistance=resistance):
        assert_alike(mine, theirs)


def test_it_drives_on_the_moon_as_the_package_does():
    (mine, theirs), *_ = both([("none", tracks()[1])], 1.5, gravity=circumstance.MOON)
    assert_alike(mine, theirs)


FEW = ("Bulldozing", "SlipSinkage", "SupplySag")
"""Effects of the slow tests: one of the soil, one of the load, one of the motors; nightly all."""
RIGID = sorted({*hidden.LISTED, *hidden.ALIASES} - {"DifferentialCompliance"})


@cache
def driven(names):
    """Return drives of effects with a rigid differential, over the ramp with a reversal and over waves with
    steering.
    """
    ways = tracks()[1:3]
    pairs = both([(name, track) for name in names for track in ways], 6.0)
    return {name: pairs[len(ways) * i : len(ways) * (i + 1)] for i, name in enumerate(names)}


def assert_the_same_law(names, name):
    for mine, theirs in driven(names)[name]:
        assert_alike(mine, theirs)


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_an_effect_is_the_same_law_here_and_there(name):
    assert_the_same_law(FEW, name)


@pytest.mark.nightly
@pytest.mark.parametrize("name", RIGID)
def test_every_effect_is_the_same_law_here_and_there(name):
    assert_the_same_law(tuple(RIGID), name)


def test_every_listed_effect_is_one_of_the_package():
    for name in hidden.LISTED | hidden.ALIASES | hidden.SENSOR:
        kind = effect_class(name)
        assert set(numbers_of(name)) <= set(kind.__dataclass_fields__)
        kind(**{**kind.neutral, **numbers_of(name)})
        for severity in (1.0, 10.0):
            kind(**{**kind.neutral, **hidden.ALL[name](np.random.default_rng(1), severity)})


def test_effects_nobody_lists_are_none_of_the_package():
    listed = {subclass.__name__ for base in (Effect, MotorEffect, BodyEffect) for subclass in base.__subclasses__()}
    assert not listed & set(hidden.OFF_LIST)


@pytest.mark.parametrize("name", sorted(hidden.SENSOR))
def test_a_faulty_sensor_reads_the_same_here_and_there(name):
    t = 0.05 * np.arange(1, 60)
    channels = ["body_pitch", "body_roll", "rocker_l", "bogie_l", "bogie_r", "body_vx", "body_x", "wheel_rate_fl"]
    true = {"t_s": t} | {key: np.sin(t + i) for i, key in enumerate(channels)}
    true |= {key: np.cos(t) for key in ("body_vy", "body_vz", *(f"wheel_rate_{wheel}" for wheel in WHEELS[1:]))}
    for seed in range(4):
        numbers = hidden.SENSOR[name](np.random.default_rng(seed), 3.0)
        read = {key: values.copy() for key, values in true.items()}
        sensors.FAULTS[name](read, **numbers)
        theirs = true | effect_class(name)(**numbers).read(t, true)
        for key, values in theirs.items():
            assert read[key] == pytest.approx(values, abs=1e-12)


def test_noise_and_steps_are_those_that_are_stated():
    t = 0.05 * np.arange(1, 8001)
    names = ("wheel_rate", "current")
    true = {"t_s": t, "body_yaw": 0 * t, "body_x": 0 * t, "battery_V": 0 * t, "slip_fl": t}
    true |= {f"{name}_{wheel}{'_A' if name == 'current' else ''}": 0 * t for name in names for wheel in WHEELS}
    read = sensors.measured(true, {}, [1.0] * 6, np.random.default_rng(0))
    assert "slip_fl" not in read
    assert np.std(read["body_x"]) == pytest.approx(0.0015, rel=0.05)
    assert np.std(read["current_fl_A"]) == pytest.approx(0.002, rel=0.05)
    assert np.std(read["wheel_rate_fl"]) == pytest.approx(np.hypot(0.01, 0.005 / np.sqrt(12)), rel=0.05)
    assert np.allclose(read["wheel_rate_fl"] / 0.005, np.round(read["wheel_rate_fl"] / 0.005))
    assert "battery_V" not in sensors.measured(true, {}, [1.0] * 6, np.random.default_rng(0), electric=False)


def test_a_plan_has_the_shares_and_every_effect():
    sets = sealed.plan(1, 100)
    kinds = [data_set["kind"] for data_set in sets]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "single": 40, "pair": 8, "none": 20, "off-list": 15, "sensor": 5, "other-law": 12,
    }  # fmt: skip
    named = {cause["effect"] for data_set in sets for cause in data_set["hidden"]}
    assert named >= set(hidden.LISTED) | set(hidden.OFF_LIST) | set(hidden.SENSOR) | set(hidden.OTHER_LAWS)
    assert all(1.0 <= cause["severity"] <= 10.0 for data_set in sets for cause in data_set["hidden"])
    assert all(
        len({cause["effect"] for cause in data_set["hidden"]}) == 2 for data_set in sets if data_set["kind"] == "pair"
    )
    assert sets == sealed.plan(1, 100) != sealed.plan(2, 100)


def test_what_a_log_declares_is_honest():
    """The truth minus the declared value, in declared SDs, has the mean 0 and the SD 1, reduced by the tails that are
    cut off.
    """
    off = []
    for index in range(150):
        nuisance = campaign.nuisance(np.random.default_rng([3, index]), index % 2 == 0)
        soil, true = nuisance[2]["soil"], nuisance[0]
        off.append(
            [
                (np.degrees(true["phi"]) - soil["phi"]["value"]) / soil["phi"]["sd"],
                *(np.log(true[name] * scale / soil[name]["value"]) * soil[name]["value"] / soil[name]["sd"]
                  for name, scale in (("k", 1e3), ("k_1", 1.0))),
            ]
        )  # fmt: skip
    assert np.mean(off, axis=0) == pytest.approx(np.zeros(3), abs=0.25)
    assert np.all(np.abs(np.std(off, axis=0) - 0.9) < 0.2)


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    """Return three sets of half a second: an effect, a soft differential, a bent ground."""
    folder = tmp_path_factory.mktemp("blind")
    sets = [
        {"index": i, "kind": "single", "hidden": [hidden.truth(name, np.random.default_rng(i))]}
        for i, name in ((1, "MultiPass"), (2, "DifferentialCompliance"), (3, "SlopeError"))
    ]
    sealed.generate(folder / "sets", sets[::2], 4, folder / "answers.json", duration=0.5)
    return folder, sets


@pytest.mark.slow
def test_sets_are_drive_logs(generated):
    folder, _ = generated
    for index, electric in ((1, False), (3, False)):
        log = read_drive_log(folder / "sets" / f"set_{index:04d}")
        assert len(log.runs) == 6
        assert log.terrain().height(0.0, -0.8) == 0.0
        assert ("battery_V" in log.runs[0].channels) is electric
        for run in log.runs:
            assert len(run["t_s"]) == 10
            assert run["body_x"][0] == pytest.approx(run.attrs["start"]["x"], abs=0.02)
            assert not any(name.startswith("slip") for name in run.channels)


@pytest.mark.slow
def test_nothing_in_the_sets_tells_the_answer(generated):
    folder, _ = generated
    for file in (folder / "sets").rglob("*"):
        text = file.read_text() if file.is_file() else ""
        assert not any(name in text for name in hidden.ALL)
        assert "severity" not in text
        assert "seed" not in text


@pytest.mark.slow
def test_answers_are_sealed(generated):
    folder, sets = generated
    digest = (folder / "sets" / "answers.sha256").read_text().split()[0]
    assert hashlib.sha256((folder / "answers.json").read_bytes()).hexdigest() == digest
    answer_list = sealed.opened(folder / "sets", folder / "answers.json")["sets"]
    assert [answer["hidden"] for answer in answer_list] == [data_set["hidden"] for data_set in sets[::2]]
    changed = [{**sets[0], "hidden": []}, sets[2]]
    with pytest.raises(SystemExit, match=r"sealed.*answers"):
        sealed.generate(folder / "sets", changed, 4, folder / "answers.json", duration=0.5)
    with pytest.raises(AssertionError, match=r"out.*sets"):
        sealed.generate(folder / "sets", sets, 4, folder / "sets" / "answers.json", duration=0.5)


@pytest.mark.slow
def test_a_set_is_made_again_as_it_was(generated, tmp_path):
    folder, sets = generated
    files = {file: file.stat().st_mtime_ns for file in (folder / "sets").rglob("*.csv")}
    sealed.generate(folder / "sets", sets[::2], 4, folder / "answers.json", duration=0.5)
    assert files == {file: file.stat().st_mtime_ns for file in (folder / "sets").rglob("*.csv")}
    sealed.generate(tmp_path / "sets", sets[:1], 4, tmp_path / "answers.json", duration=0.5)
    for file in (tmp_path / "sets" / "set_0001").iterdir():
        assert file.read_bytes() == (folder / "sets" / "set_0001" / file.name).read_bytes()
    salts = [json.loads((place / "answers.json").read_text())["salt"] for place in (folder, tmp_path)]
    assert salts[0] != salts[1]
