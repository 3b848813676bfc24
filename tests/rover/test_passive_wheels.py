"""Wheels that no motor turns, or that hang above the ground: named, by `new-rover` and `check-urdf`."""

import json
import re

import numpy as np
import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import hanging_wheels, wheel_loads
from tests.rover.farm import ROCKERS, SIZE, THREE_AXLES, TWO_AXLES, Farm, cart, rocker_bogie, write


def with_swivels(name, trail, kind="continuous"):
    """Two driven wheels and two behind, each on an upright joint."""
    farm = Farm(centre="-0.1 0 0.2")
    for side, y in (("l", 0.3), ("r", -0.3)):
        farm.wheel(f"drive_{side}", "body", f"0.1 {y} 0")
        farm.link(f"{name}_{side}", "body", kind, f"-0.4 {y} 0", axis="0 0 1", mass=0.3)
        farm.wheel(f"{name}_wheel_{side}", f"{name}_{side}_link", f"{-trail} 0 0")
    return farm


def omnidirectional():
    farm = cart()
    for name in ("fl", "fr", "rl", "rr"):
        for at, (x, z) in enumerate(((0.12, 0), (-0.12, 0), (0, 0.12), (0, -0.12))):
            farm.wheel(f"{name}_small_{at}", f"{name}_link", f"{x} 0 {z}", axis="1 0 0", r=0.03, drawn="0 1.5707963 0")
    return farm


def tracked():
    farm = Farm()
    for x in (0.4, 0.0, -0.4):
        for side, y in (("l", 0.35), ("r", -0.35)):
            farm.wheel(f"{side}_track_wheel_{'fmr'[int(1.25 - 2.5 * x)]}", "body", f"{x} {y} 0")
    return farm


def proposed(farm, tmp_path):
    (tmp_path / "rover.urdf").write_text(farm.urdf)
    return new_rover(tmp_path / "rover.urdf").proposal


@pytest.mark.parametrize(
    ("farm", "named"),
    [
        (with_swivels("caster", 0.0), r"caster_wheel_l, caster_wheel_r are the wheels of castors"),
        (with_swivels("aux", 0.06), r"aux_wheel_l, aux_wheel_r are the wheels of castors"),
        (omnidirectional(), r"fl_small_0.* of rollers"),
        (tracked(), r"l_track_wheel_f.* of a track"),
    ],
    ids=["castors by name", "castors by their trail", "rollers on wheels", "track"],
)
def test_what_no_motor_turns_is_refused(farm, named, tmp_path):
    with pytest.raises(UrdfError, match=named):
        proposed(farm, tmp_path)


@pytest.mark.parametrize("farm", [with_swivels("steer", 0.0), with_swivels("steer", 0.06, "revolute")])
def test_wheels_that_are_steered_are_no_castors(farm, tmp_path):
    assert proposed(farm, tmp_path).axles[-1].steering == ("steer_l", "steer_r")


def test_castors_in_a_toml_by_hand_are_noted(run, tmp_path):
    """Their swivel has got stops half a turn to either side by then."""
    table = {"wheels": {"front": ["drive_l", "drive_r"], "rear": ["aux_wheel_l", "aux_wheel_r"]}, "wheel": SIZE}
    table["steering"] = {"rear": ["aux_l", "aux_r"]}
    code, out, _ = run("check-urdf", write(tmp_path, with_swivels("aux", 0.06), table), "--json")
    notes = json.loads(out)["notes"]
    assert code == 0
    assert any("aux_wheel_l, aux_wheel_r" in note and "castor" in note for note in notes)


def raised(height):
    """Six wheels on a rigid body, those in the middle higher."""
    farm = cart()
    for side, y in (("l", 0.35), ("r", -0.35)):
        farm.wheel(f"m{side}", "body", f"0 {y} {height}")
    return farm


def test_raised_wheels_hang_and_carry_nothing(tmp_path):
    rover = load_rover(write(tmp_path, raised(0.05), THREE_AXLES))
    gaps = hanging_wheels(rover)
    assert gaps == pytest.approx({"ml": 0.05, "mr": 0.05})
    loads = wheel_loads(rover, 0.0, hanging=gaps)
    assert loads[2:4] == pytest.approx(0.0, abs=1e-9)
    assert np.sum(loads) == pytest.approx(rover.mass * 9.81)


def test_four_wheels_of_two_sizes_all_stand(tmp_path):
    """The smaller pair's centres lie lower by as much; half a slope tilts the body where they do not."""
    sizes = {**SIZE, "rear": {"r": 0.1}}
    farm = cart()
    assert hanging_wheels(load_rover(write(tmp_path, farm, {**TWO_AXLES, "wheel": sizes}))) == {}


def test_a_suspension_lets_its_wheels_down(tmp_path):
    assert hanging_wheels(load_rover(write(tmp_path, rocker_bogie(), {**THREE_AXLES, **ROCKERS}))) == {}


def test_the_command_says_who_carries_nothing(run, tmp_path):
    path = write(tmp_path, raised(0.08), THREE_AXLES)
    code, out, _ = run("check-urdf", path, "--json")
    assert code == 0
    assert re.search("ml, mr .*80 mm", json.loads(out)["stands"])
    path = write(tmp_path, raised(0.001), THREE_AXLES)
    assert "carry nothing" not in run("check-urdf", path, "--json")[1]
