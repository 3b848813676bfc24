"""What one sees who types the name of an object: a line or two, whatever it holds."""

import dataclasses
import html
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Soil, Wheel, scenario, torque_bounds
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.loop.close import read_data, verdict_on
from rover_pin.loop.identify import identify
from rover_pin.sweep import read_study
from rover_pin.tuning.study_file import read_tuning
from tests.experiments.wheel_rig import linear_rig

STUDIES = Path(__file__).parents[2] / "studies"
MOST = 400


@pytest.fixture(scope="module")
def public_objects():
    """One object of every class of this package that comes to a user, or is a part of one that does."""
    drive = scenario("ditch", control="eq9", duration=1.0)
    rig, log = read_data("cmu-smooth-wheel"), read_data("steepening-slope")
    roots = [drive, rig, log, torque_bounds(9.5, Soil(), Wheel())]
    roots += [read_study(STUDIES / "sweep_ditch.toml"), read_tuning(next(STUDIES.glob("tune*.toml")))]
    rows, slope = np.random.default_rng(0).normal(size=(2, 2 * linear_rig.RUNS))
    bed = linear_rig.made(rows, {"soil.phi": linear_rig.law_of("soil.phi", slope)})
    roots += [verdict_on(RigData(bed, linear_rig.MODEL))]
    roots += [identify("cmu-smooth-wheel"), drive.drive()]
    objects, class_names = {}, set()
    while roots:
        thing = roots.pop()
        if id(thing) in class_names:
            continue
        class_names.add(id(thing))
        if type(thing).__module__.startswith("rover_pin."):
            objects.setdefault(type(thing), thing)
        roots += parts(thing)
    return objects


def parts(thing):
    if dataclasses.is_dataclass(thing):
        return [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    return list(thing.values()) if isinstance(thing, dict) else list(thing) if isinstance(thing, (tuple, list)) else []


def test_every_object_is_shown_in_a_few_letters(public_objects):
    assert {"Scenario", "Model", "Rover", "Trace", "DriveLog", "RigSet", "Verdict", "Identification", "Study"} <= {
        kind.__name__ for kind in public_objects
    }
    long = {kind.__name__: len(repr(thing)) for kind, thing in public_objects.items() if len(repr(thing)) > MOST}
    assert not long


def test_what_it_is_can_be_seen(public_objects):
    texts = {kind.__name__: repr(thing) for kind, thing in public_objects.items()}
    assert texts["Scenario"].startswith("Scenario(name='ditch', model=<Model>, controller=")
    assert texts["Trace"] == "<Trace: 20 rows of 87 channels, 0.05 to 1 s, stop: duration>"
    assert texts["Rover"].startswith("Rover(name='nexus6', ")


def test_notebooks_get_a_table_or_the_summary(public_objects):
    things = {kind.__name__: thing for kind, thing in public_objects.items()}
    assert "<th scope='row'>gravity</th><td>9.81</td>" in things["Model"]._repr_html_()
    verdict = things["Verdict"]
    assert verdict._repr_html_() == f"<pre>{html.escape(verdict.summary())}</pre>"
    assert all(hasattr(things[name], "_repr_html_") for name in ("Scenario", "Trace", "Rover", "Identification"))
