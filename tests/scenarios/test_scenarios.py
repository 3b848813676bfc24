"""Every ready-made drive drives, other rovers and terrains from files included, and its log is a drive log."""

import dataclasses
import re

import numpy as np
import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.scenarios.scenario import scenario
from rover_pin.scenarios.scenes import SCENES
from rover_pin.simulation.model.toml_file import write_model

FROM_FILES = ("polyline", "grid")


@pytest.mark.parametrize("name", [name for name in SCENES if name not in FROM_FILES])
def test_every_scenario_drives(name):
    trace = scenario(name, duration=2.0).drive()
    assert trace.attrs["stop"] == "duration"
    assert np.all(np.isfinite(trace.to_frame().to_numpy(dtype=float)))
    assert trace.energy_error() < 0.02


@pytest.mark.parametrize("slip", ["relaxed", "algebraic"])
@pytest.mark.parametrize("angles", ["fixed", "sinkage"])
@pytest.mark.parametrize("form", ["net", "torque", "gross"])
def test_every_form_drives_and_is_named(form, angles, slip):
    trace = scenario("flat", duration=1.0, form=form, angles=angles, slip=slip).drive()
    assert trace.attrs["traction_form"] == form
    assert trace.attrs["slip_law"].lower().startswith(slip)


def test_a_rover_with_other_names_and_four_wheels_drives():
    trace = scenario("flat", duration=4.0, rover="cart").drive()
    assert len(trace.wheels) == 4
    assert trace["body_x"][-1] > 0.05


def test_a_terrain_from_a_file_with_a_hard_stretch(tmp_path):
    (tmp_path / "t.csv").write_text("x_m,z_m\n-5,0\n0.3,0\n5,0\n")
    path = {"terrain.path": str(tmp_path / "t.csv")}
    soft = scenario("polyline", duration=4.0, **path).drive()
    hard = scenario("polyline", duration=4.0, **path, **{"patch.x_from": -3.0}).drive()
    assert hard["sinkage_fl"][-1] < 0.3 * soft["sinkage_fl"][-1]
    with pytest.raises(DataError, match=r"nowhere.csv"):
        scenario("polyline", **{"terrain.path": "nowhere.csv"})


def test_the_log_of_a_drive_declares_what_made_it(tmp_path):
    drive = scenario("bump", duration=1.0, **{"soil.k": 0.02})
    trace = drive.drive()
    log = read_drive_log(drive.write_log(trace, tmp_path / "log"))
    assert log.metadata.soil["k"]["value"] == 0.02
    assert log.metadata.motor["supply"]["value"] == 7.2
    assert log.terrain() == drive.model.terrain
    assert np.array_equal(log.runs[0]["body_x"], trace["body_x"])


SIDEWAYS = {"CombinedShear", "FlankPressure"}


def side(name, **settings):
    case = scenario(name, duration=1.0, **settings)
    kinds = {type(assumption).__name__ for assumption in case.model.effects} & (SIDEWAYS | {"SideShear"})
    return kinds, [assumption for assumption in case.assumed if "side force" in assumption]


@pytest.mark.parametrize("name", ["turn", "point-turn", "crab", "cross-slope"])
def test_thrust_and_side_force_share_strength_in_side_motion(name):
    """The law of the wheel rigs, said in the trace, with a way back."""
    kinds, assumptions = side(name)
    assert kinds == SIDEWAYS
    assert "SideShear" in assumptions[0]
    assert side(name, side="shear") == ({"SideShear"}, [])
    assert side(name, side="combined") == (SIDEWAYS, [])
    assert assumptions[0] in scenario(name, duration=0.2).drive().attrs["assumed"]


def test_straight_drives_keep_the_logs_side_force_turns_do_not():
    assert side("flat") == ({"SideShear"}, [])
    assert side("flat", control="turn")[0] == side("flat", side="combined")[0] == SIDEWAYS
    angled = scenario("turn", angles="sinkage", form="gross").model
    shear, traction = (next(effect for effect in angled.effects if type(effect).__name__ == name)
                       for name in ("CombinedShear", "SoilTraction"))  # fmt: skip
    assert (shear.form, shear.angles) == (traction.form, traction.angles)
    with pytest.raises(ParameterError, match=r"side = 'shaer'.*did.*'shear'"):
        scenario("turn", side="shaer")


def resistance(**settings):
    return float(scenario("flat", **settings).model.effect(MotionResistance).R)


@pytest.mark.parametrize(
    "settings",
    [{}, {"soil.k": "10mm"}, {"soil": "table-1", "soil.k": "3mm"}, {"soil": "dry-sand", "soil.phi": "40deg"},
     {"rover": "cart"}, {"rover": "cart", "gravity": "moon"},
     {"soil": "mars-sand", "form": "gross", "angles": "sinkage"}],
    ids=str,
)  # fmt: skip
def test_driven_wheels_drive_level_ground_on_every_soil(settings):
    """R follows soil, wheels and load: nothing skids at S < 0, and nothing is said of it."""
    trace = scenario("flat", duration=5.0, **settings).drive()
    assert trace.stack("slip")[-1].min() > 0.0
    assert np.mean(trace.stack("slip")[-1]) == pytest.approx(0.05, abs=0.01)
    assert not trace.attrs["notes"]


def test_declared_resistance_stays_and_skidding_wheels_are_noted(tmp_path):
    settings = {"soil": "table-1", "soil.k": "10mm", "effect.MotionResistance.R": 0.028}
    drive = scenario("flat", duration=3.0, **settings)
    trace = drive.drive()
    assert trace.summary()["motion_resistance_R"] == 0.028
    (note,) = trace.attrs["notes"]
    slip = float(re.search(r"driven wheels skid at S = (-[\d.]+) on level ground", note)[1])
    assert np.mean(trace.stack("slip")[-1]) == pytest.approx(slip, abs=2e-3)
    write_model(drive.model, tmp_path / "model.toml", "as declared")
    assert resistance(model=str(tmp_path / "model.toml"), gravity="moon") == 0.028
    assert not scenario("flat", duration=0.5, **{**settings, "effect.MotionResistance.R": 0.1}).drive().attrs["notes"]


def test_log_declares_its_resistance_and_the_loop_starts_with_it(tmp_path):
    drive = scenario("flat", duration=1.0, **{"soil.k": 0.01})
    log = read_drive_log(drive.write_log(drive.drive(), tmp_path / "log"))
    assert base_model(log).effect(MotionResistance) == drive.model.effect(MotionResistance)
    undeclared = dataclasses.replace(log, metadata=dataclasses.replace(log.metadata, resistance={}))
    assert float(base_model(undeclared).effect(MotionResistance).R) == resistance(cruise_slip=0.05, **{"soil.k": 0.01})


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"cruise_slip": 0.05, "form": "net"}, "compaction resistance"),
        ({"cruise_slip": -0.9}, r"resistance R.*\[0, 1\]"),
        ({"cruise_slip": 1.5}, r"[Gg]ive.*\(-1, 1\]"),
        ({"cruise_slip": 0.1, "effect.MotionResistance.R": 0.1}, "both.*R"),
        ({"control": "pid"}, "control = 'pid'"),
        ({"form": "nett"}, "mean 'net'"),
        ({"terrain.wall_angel_deg": 30}, "setting"),
        ({"effect.NormalDamping.d": -1.0}, "NormalDamping.d = -1 s/m"),
        ({"motor.supply": 0.0}, "motor.supply = 0 V"),
    ],
)
def test_wrong_settings_are_said(settings, words):
    with pytest.raises(ParameterError, match=words):
        scenario("ditch", **settings)


def test_crab_angle_falls_short_with_unsteered_middle_wheels():
    """Of 20 deg 16.9; dragged wheels bear 0.33 of their load sideways, 0.40 with `SideShear`."""
    sand = {"soil": "table-1", "soil.k": 0.003}
    for side_force, share in ((None, 0.332), ("shear", 0.399)):
        trace = scenario("crab", duration=10.0, **sand, **({"side": side_force} if side_force else {})).drive()
        late = trace.t > 5.0
        dx, dy = (np.diff(trace[f"body_{axis}"][late]) for axis in "xy")
        assert np.degrees(np.mean(np.arctan2(dy, dx) - trace["body_yaw"][late][1:])) == pytest.approx(16.9, abs=0.1)
        side_over_load = np.abs(trace.stack("lateral")[late]) / trace.stack("normal")[late]
        assert side_over_load.mean(axis=0).max() == pytest.approx(share, abs=0.01)
    right = scenario("crab", duration=5.0, **{"control.angle_deg": -20.0}).drive()
    assert right["body_y"][-1] < -0.02
    with pytest.raises(ParameterError, match="control ="):
        scenario("crab", rover="cart")


@pytest.mark.parametrize(("k", "form", "slip"), [(0.01, "torque", 0.05), (0.02, "gross", 0.1)])
def test_the_flat_is_cruised_at_the_slip_that_is_asked_for(k, form, slip):
    """The wheels' mean, weighted by their loads: each has the same duty, and so its own slip."""
    trace = scenario("flat", form=form, cruise_slip=slip, duration=6.0, **{"soil.k": k}).drive()
    mean = np.average(trace.stack("slip")[-1], weights=trace.stack("normal")[-1])
    assert mean == pytest.approx(slip, abs=3e-3)
    assert trace.summary()["motion_resistance_R"] == resistance(form=form, cruise_slip=slip, **{"soil.k": k})
