"""`list` says what there is: all of it, as the package has it, with unit, bounds, default and source."""

import json
import math

import pytest

from rover_pin import SOILS, RoverPinError, load_rover, scenario
from rover_pin.parameters import SLOPE_SAND
from rover_pin.parameters.soils import SLOPE_SAND_SOURCE
from rover_pin.scenarios.catalogue import settings
from rover_pin.scenarios.scenes import SCENES
from rover_pin.simulation.model.effect_files import package_effects


def listed(run, *words):
    code, out, _ = run("list", *words, "--json")
    assert code == 0
    return json.loads(out)


@pytest.mark.parametrize(
    ("what", "names"),
    [("scenarios", set(SCENES)), ("soils", set(SOILS)), ("effects", {kind.__name__ for kind in package_effects()})],
)
def test_all_are_listed_with_what_they_are(run, what, names):
    entries = listed(run, what)[what]
    assert {entry["name"] for entry in entries} == names
    assert all(len(entry["about"]) > 10 for entry in entries)
    _, out, _ = run("list", what)
    assert all(any(line.startswith(name) for line in out.splitlines()) for name in names)


def test_settings_have_unit_bounds_default_and_source(run):
    (k,) = [setting for setting in listed(run, "settings")["settings"] if setting["name"] == "soil.k"]
    assert k == {"name": "soil.k", "value": 0.008, "unit": "m", "low": 1e-5, "high": 0.5, "source": SLOPE_SAND_SOURCE}


@pytest.mark.parametrize("name", [name for name in SCENES if name not in ("polyline", "grid")])
def test_every_setting_that_is_listed_can_be_given_as_it_stands(name):
    """The list is not a second list: what it names is taken, and its defaults change nothing.

    But for a patch, which is none by default, and for gear friction, whose own number is listed too where it is.
    """
    settings_as_listed = {
        setting.name: setting.value
        for setting in settings(name)
        if setting.value is not None and setting.value != () and not setting.name.startswith("patch.")
    }
    settings_as_listed.pop("gear_friction")
    case, again = scenario(name), scenario(name, **settings_as_listed)
    assert again.model.soils == case.model.soils
    assert again.model.terrain == case.model.terrain
    assert again.duration == case.duration
    assert again.start == case.start


def test_a_unit_and_si_are_the_same_drive():
    words = {"soil.k": "5mm", "soil.phi": "32deg", "terrain.wall_angle": "40 deg", "gravity": "1.62 m/s^2"}
    numbers = {"soil.k": 0.005, "soil.phi_deg": 32.0, "terrain.wall_angle_deg": 40.0, "gravity": 1.62}
    case, scene = scenario("ditch", **words, duration="2s"), scenario("ditch", **numbers, duration=2.0)
    assert case.model.soils[0] == scene.model.soils[0] == SLOPE_SAND.replace(k=0.005, phi=scene.model.soils[0].phi)
    assert case.model.terrain == scene.model.terrain
    assert (case.duration, case.model.gravity) == (scene.duration, scene.model.gravity)


@pytest.mark.parametrize(
    ("name", "setting"),
    [(name, entry) for name in ("ditch", "hills", "field", "turn", "step") for entry in settings(name)
     if entry.name.startswith(("terrain", "start", "control.")) and math.isfinite(entry.low)],
    ids=lambda entry: entry if isinstance(entry, str) else entry.name,
)  # fmt: skip
def test_a_bound_that_is_listed_holds(name, setting):
    outside = setting.low - max(1.0, abs(setting.low))
    with pytest.raises(RoverPinError, match=f"{setting.name} = .*allowed"):
        scenario(name, **{setting.name: outside})


def test_list_alone_lists_what_there_is(run):
    code, out, _ = run("list")
    assert code == 0
    for name in ("ditch", "table-1", "nexus6", "SlipSinkage", "soil.k", "cmu-smooth-wheel"):
        assert name in out


def test_rovers_have_their_wheels_and_mass(run):
    rovers = {entry["name"]: entry for entry in listed(run, "rovers")["rovers"]}
    assert {"nexus6", "cart"} <= set(rovers)
    assert rovers["nexus6"]["wheels"] == 6
    assert rovers["cart"]["mass_kg"] == pytest.approx(load_rover("cart").mass)
    (radius,) = [number for number in rovers["cart"]["numbers"] if number["name"] == "r"]
    assert radius["value"] == 0.11
    assert "0.045" in radius["source"]  # the default, the wheel of the paper
