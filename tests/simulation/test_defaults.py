"""The default motor, soil and terrain of a rover whose files state none: they follow from its weight and wheels, and
are reported.
"""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from rover_pin import SOILS, load_rover, scenario
from rover_pin.base.errors import ParameterError
from rover_pin.control.slip_estimate import flat_table
from rover_pin.parameters import SLOPE_SAND
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenes import scale_arguments
from rover_pin.simulation.model.defaults import own_motor, own_soil
from rover_pin.terrain import shapes
from rover_pin.terrain.shapes import paper_field
from tests.rover import farm as made

NEXUS6 = load_rover("nexus6")


@pytest.fixture
def rover_file(tmp_path):
    """Write a six-wheeled rover of 55 kg on wheels of radius 150 mm whose TOML states neither a motor nor a soil."""
    return made.write(tmp_path, made.rocker_bogie(), {**made.THREE_AXLES, **made.ROCKERS})


def test_the_rule_for_the_soil_gives_nexus_6_its_own():
    """The rule gives Nexus 6 the k_1 of Table 1. The tolerance 3e-3 covers the rounded mass 5.8 kg, the rounded 9.81
    m/s^2 and the angle of the load.
    """
    soil, source = own_soil(dataclasses.replace(NEXUS6, soil={}))
    assert float(soil.k_1) == pytest.approx(float(SOILS["table-1"].k_1), rel=1e-4)
    assert re.search("table-1 with k = 50 mm.*k_1 = 5.42e\\+04 Pa", source[0])


@pytest.mark.parametrize("rover", ["nexus6", "nexus6_links", "cart"])
def test_on_slope_sand_rovers_slip_as_measured_wheels_do(rover):
    """Measured wheels slip by 0.2 on 10 to 14 deg (Ding et al. 2011, Fig 9). On the paper's sand the slip would be
    nearly 1.
    """
    steep = {"terrain.angle_deg": 10.0, "terrain.start": -20.0, "control.delta": 0.7}

    def slip(**soil):
        trace = scenario("incline", rover=rover, duration=15.0, **steep, **soil).drive(measure_error=False)
        return np.average(trace.stack("slip")[-1], weights=trace.stack("normal")[-1])

    assert slip() == pytest.approx(0.22, abs=0.02)
    assert slip(soil="table-1") > 0.55


def test_the_sized_motor_turns_on_the_spot(rover_file):
    """The axles are at 0.5, -0.05 and -0.55 m, and the sides are 0.8 m apart. The thrusts turn the rover against the
    wheels that are dragged sideways.
    """
    rover = load_rover(rover_file)
    motor, (assumption,) = own_motor(rover)
    load = rover.mass * 9.81 / 6
    moment = 2 * math.tan(float(SLOPE_SAND.phi)) * load * (0.5333 + 0.0167 + 0.5167)
    assert 6 * 0.55 * float(motor.stall_torque) / 0.15 * 0.4 == pytest.approx(moment, rel=1e-3)
    assert f"turn {rover.mass:.3g} kg on the spot" in assumption
    speeds = [0.15 * float(motor.no_load_rate) / math.sqrt(0.15), 0.05 / 0.55 / math.sqrt(0.045)]
    assert speeds[0] == pytest.approx(speeds[1])


def test_a_data_sheet_is_taken_at_the_wheel(tmp_path):
    sheet = {
        "stall_torque": {"value": 250, "unit": "mN m"},
        "no_load_speed": {"value": 6000, "unit": "rpm"},
        **{"voltage": 24.0, "gear": 100.0, "efficiency": 0.8, "rotor_inertia": 1e-6},
    }
    path = made.write(
        tmp_path, made.cart(), {**made.TWO_AXLES, "motor": sheet, "soil": {"name": "hit-lss1", "k": 0.02}}
    )
    drive = scenario("flat", rover=str(path))
    motor, soil = drive.model.motor, drive.model.soils[0]
    assert float(motor.stall_torque) == pytest.approx(0.8 * 100 * 0.25)
    assert float(motor.no_load_rate) == pytest.approx(6000 * math.pi / 30 / 100)
    assert float(motor.armature) == pytest.approx(1e-2)
    assert (float(soil.k), float(soil.phi)) == (0.02, float(SOILS["hit-lss1"].phi))
    assert [line.split(":")[0] for line in drive.assumed] == ["motion resistance"]


def test_a_heavy_rover_cruises_at_the_stated_slip(rover_file):
    """R is computed for the rover's own load. With the R of Nexus 6, heavy rovers would drive at S < 0."""
    trace = scenario("flat", rover=str(rover_file)).drive()
    late = trace.t > 0.6 * trace.t[-1]
    assert trace["body_x"][-1] > 0.3
    assert np.mean(trace.stack("slip")[late]) == pytest.approx(0.05, abs=0.02)
    assert any("motor: none" in line for line in trace.summary()["assumed"])


def test_a_wheel_that_no_soil_carries_is_refused(rover_file):
    heavy = load_rover(rover_file).carrying(1e9)
    with pytest.raises(ParameterError, match=r"k_1.*1e9 Pa"):
        own_soil(heavy)


def test_eq_9_has_the_table_of_the_rover_that_drives(rover_file):
    model = scenario("flat", rover=str(rover_file)).model
    table = flat_table(model)
    free = 0.55 * 0.15 * float(model.motor.no_load_rate)
    assert 0.4 * free < table.speed_at(np.array([0.55]))[0] < free
    assert table != flat_table(scenario("flat").model)


def larger(text: str, size: float) -> str:
    """Return the URDF of a rover whose lengths are multiplied by `size` at equal density."""

    def times(power):
        return lambda expected: (
            expected[1] + " ".join(repr(float(word) * size**power) for word in expected[2].split()) + '"'
        )

    text = re.sub(r'((?:xyz|radius|length)=")([^"]*)"', times(1), re.sub(r"<axis[^>]*>", "@", text))
    text = text.replace("@", '<axis xyz="0 1 0"/>')
    return re.sub(r'(i[xyz]{2}=")([^"]*)"', times(5), re.sub(r'(<mass value=")([^"]*)"', times(3), text))


SIZE = 4.0


def test_a_rover_four_times_as_large_drives_the_same_way(tmp_path):
    """Froude similarity: with scaled k and c of the soil, lengths scale by 4 and times by 2. Any number that was not
    scaled (servos, stops, relaxation, resistance, motor, soil, ditch) would break the similarity.
    """
    small = made.rocker_bogie().urdf
    ways = []
    for size in (1.0, SIZE):
        (folder := tmp_path / f"{size}").mkdir()
        table = {**made.THREE_AXLES, **made.ROCKERS, "wheel": {"r": 0.15 * size, "b": 0.1 * size}}
        path, slow = made.write(folder, larger(small, size), table), math.sqrt(size)
        effects = {"NormalDamping.d": 10 / slow, "MotionResistance.v_0": 0.005 * slow}
        drive = scenario(
            *("ditch",), rover=str(path), dt=0.005 * slow, soil="table-1",
            **{"soil.k": 0.02 * size, "soil.c": 0.005 * size, "soil.k_1": 4.3e4 * size, "cruise_slip": 0.05},
            **{f"effect.{name}": value for name, value in effects.items()},
        )  # fmt: skip
        model = drive.model.replace(slip=drive.model.slip.replace(damping=0.1 * slow))
        trace = dataclasses.replace(drive, model=model).drive()
        ways.append((trace.t / slow, trace["body_x"] / size, trace["bogie_l"]))
    (t, x, bogie), (t_large, x_large, bogie_large) = ways
    assert t_large[-1] == pytest.approx(t[-1], rel=1e-6)
    assert np.abs(bogie).max() > 0.02
    assert np.interp(t, t_large, x_large) == pytest.approx(x, abs=2e-3)
    assert np.interp(t, t_large, bogie_large) == pytest.approx(bogie, abs=5e-3)


def test_terrains_grow_with_the_wheels_except_for_given_sizes():
    assert scale_arguments(shapes.ditch, {"wall_angle": 0.5}, 2.0) == {
        "depth": 0.1, "width": 0.4, "wall_angle": 0.5, "at": 1.0,
    }  # fmt: skip
    assert scale_arguments(shapes.ditch, {}, 0.9)["depth"] == pytest.approx(0.9 * 0.05)
    assert scale_arguments(shapes.growing_slope, {}, 2.0)["rate"] == pytest.approx(math.radians(5.0))
    assert scale_arguments(shapes.rocks, {}, 2.0)["diameters"] == (0.1, 0.2)
    field, half = paper_field(**scale_arguments(paper_field, {}, 2.0)), paper_field()
    for large, small in zip(field.profiles, half.profiles, strict=True):
        assert large.x[1:-1] == pytest.approx(2.0 * small.x[1:-1])
        assert large.z[1:-1] == pytest.approx(2.0 * small.z[1:-1])


def sprung(k_s: float) -> dict:
    """Return a rover whose rockers are held by springs instead of a differential."""
    springs = {"rocker": {"k_s": {"value": k_s, "unit": "N m/rad"}, "d": 5.0}}
    return {**made.THREE_AXLES, "suspension": made.ROCKERS["suspension"], "springs": springs}


def test_springs_carry_a_body_that_pivots_would_let_go(tmp_path):
    free = load_rover(made.write(tmp_path, made.rocker_bogie(), {**sprung(1.0), "springs": {}}))
    with pytest.raises(ParameterError, match=r"cannot.*wheels"):
        wheel_loads(free, 0.02)
    joined = load_rover(made.write(tmp_path, made.rocker_bogie(), {**made.THREE_AXLES, **made.ROCKERS}))
    rover = load_rover(made.write(tmp_path, made.rocker_bogie(), sprung(400.0)))
    loads = wheel_loads(rover, 0.0)
    assert loads.sum() == pytest.approx(rover.mass * 9.81)
    stiff = load_rover(made.write(tmp_path, made.rocker_bogie(), sprung(4e3)))
    assert wheel_loads(stiff, 0.0, 0.1).sum() == pytest.approx(wheel_loads(joined, 0.0, 0.1).sum(), rel=1e-9)


def test_a_sprung_rover_settles_where_its_springs_balance(tmp_path):
    """At rest on the soil, the moment of the wheel loads about a rocker's pivot equals k_s times the rocker's angle."""
    path = made.write(tmp_path, made.rocker_bogie(), sprung(400.0))
    model = scenario("flat", rover=str(path)).model
    assert [effect.joint for effect in model.body_effects] == ["rocker"]
    trace = scenario("flat", rover=str(path), duration=1.0, **{"control.delta": 0.0}).drive()
    loads = np.array([trace[f"normal_{wheel}"][-1] for wheel in trace.wheels])
    assert loads.sum() == pytest.approx(model.rover.mass * 9.81, rel=0.01)
    wheel_loads_at_rest = wheel_loads(model.rover, 0.0)
    assert loads == pytest.approx(wheel_loads_at_rest, rel=0.08)
