"""Whether check-urdf says truly that a rover stands and moves: against drives of the same rover."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from rover_pin import load_rover, load_traction_factor, scenario
from rover_pin.cli.app import app
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.scenarios.road_check import road_check
from rover_pin.soil.wheel_forces import TorqueTraction
from tests.rover import farm as made


def rover_with(folder: Path, **more) -> Path:
    return made.write(folder, made.rocker_bogie(), {**made.THREE_AXLES, **made.ROCKERS, **more})


def motor(stall: float) -> dict:
    return {"stall_torque": stall, "no_load_speed": 2.0}


def test_the_rovers_that_come_along_stand_and_move():
    for name in ("nexus6", "nexus6_links", "cart"):
        check = road_check(load_rover(name))
        assert check.faults == ()
        assert check.stands.startswith("yes")
        assert check.moves.startswith("yes")
    assert road_check(load_rover("nexus6")).assumed == ()


def test_loads_and_depths_are_those_of_a_drive_at_rest(tmp_path):
    path = rover_with(tmp_path)
    low, high, shallow, deep = map(float, re.findall(r"[\d.]+", road_check(load_rover(path)).stands)[:4])
    trace = scenario("flat", rover=str(path), duration=0.5, **{"control.delta": 0.0}).drive()
    loads = [trace[f"normal_{wheel}"][-1] for wheel in trace.wheels]
    depths = [1e3 * trace[f"sinkage_{wheel}"][-1] for wheel in trace.wheels]
    assert (min(loads), max(loads)) == pytest.approx((low, high), rel=0.06)
    assert (min(depths), max(depths)) == pytest.approx((shallow, deep), rel=0.06)


@pytest.mark.parametrize(("stall", "goes"), [(0.6, False), (6.0, True)])
def test_a_motor_that_is_too_weak_is_told_and_stalls(tmp_path, stall, goes):
    """The torque that the flat takes lies between: a drive stalls below it and goes above it."""
    path = rover_with(tmp_path, motor=motor(stall))
    check = road_check(load_rover(path))
    needed = float(re.search(r"the flat takes ([\d.]+) N m", check.moves)[1])
    assert (0.55 * stall > needed) == goes
    assert check.moves.startswith("yes" if goes else "no")
    assert (check.faults == ()) == goes
    outcome = scenario("flat", rover=str(path), duration=10.0).drive().summary()["outcome"]
    assert outcome.startswith("drives on" if goes else ("stalled", "nearly stalled"))


def test_the_slope_that_the_motors_hold_is_that_of_a_drive(tmp_path):
    """On soil that grips, a rover at full duty stops between 0.5 and 1.1 times the tangent that is told."""
    path = rover_with(tmp_path, motor=motor(4.0), soil={"name": "table-1", "k": 0.02, "k_1": 6e4})
    check = road_check(load_rover(path))
    value = float(re.search(r"motors hold ([\d.]+) deg", check.moves)[1])
    assert "motors give" in check.moves

    def speed(share: float) -> float:
        slope = math.atan(share * math.tan(math.radians(value)))
        drive = scenario("incline", rover=str(path), duration=8.0, **{
            "terrain.angle": slope, "terrain.start": -9.0, "control.delta": 1.0,
        })  # fmt: skip
        trace = drive.drive()
        return float((trace["body_x"][-1] - trace["body_x"][-20]) / (trace.t[-1] - trace.t[-20]))

    assert speed(0.8) > 0.01
    assert speed(1.15) < 0.01


def test_slope_held_by_the_soil_is_its_pull_minus_the_resistance(tmp_path):
    """tan of it = F(S) - R, but for what the slope shifts from front to rear and how deep the wheels are: 2.5 deg."""
    path = rover_with(tmp_path, motor=motor(30.0), soil={"name": "table-1", "k": 0.01})
    match = re.search(r"the soil (\d+) deg at S = 1 and (\d+) deg at S = 0.2", road_check(load_rover(path)).moves)
    model = scenario("flat", rover=str(path)).model
    R, wheel = float(model.effect(MotionResistance).R), model.rover.wheel
    full, part = (float(load_traction_factor(S, model.soils[0], wheel, TorqueTraction())) for S in (1.0, 0.2))
    assert [math.radians(int(degrees)) for degrees in match.groups()] == pytest.approx(
        [math.atan(full - R), math.atan(part - R)], abs=math.radians(2.5)
    )
    assert math.atan(R) > math.radians(2.5)


def test_command_reports_standing_motion_and_assumptions(tmp_path, capsys):
    for more, code, moves in (({}, 0, "yes"), ({"motor": motor(0.1)}, 1, "no: its motors stall")):
        path = rover_with(tmp_path, **more)
        with pytest.raises(SystemExit) as exit_info:
            app(["check-urdf", str(path), "--json"])
        assert exit_info.value.code == code
        report = json.loads(capsys.readouterr().out)
        assert report["stands"].startswith("yes")
        assert report["moves"].startswith(moves)
        assert any("soil: none named" in line for line in report["assumed"])
        assert len(report["faults"]) == code


def test_a_soil_that_buries_it_is_told(tmp_path):
    path = rover_with(tmp_path, soil={"name": "table-1", "k_1": 5e3})
    check = road_check(load_rover(path))
    assert re.match("no: .*(buried|90 deg)", check.stands)
    assert check.moves.startswith("no")
