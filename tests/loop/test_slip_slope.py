"""Slip against slope of a whole rover: an experiment beside rig sets and drive logs."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.slip_slope import SlipSlope
from rover_pin.loop.close import close_the_loop
from rover_pin.rover.proposal.new_rover import new_rover
from tests.oracle import slope_generator as generator

TOML = """kind = "slip-slope"
name = "skid"
rover = "rover.toml"
[soil]
phi = { value = 31.5, unit = "deg", sd = 3.0 }
k = { value = 40, unit = "mm", sd = 20 }
k_1 = { value = 65, unit = "kPa", sd = 30 }
"""


def folder(tmp_path, text=TOML, **options):
    (tmp_path / "rover.urdf").write_text(generator.field_log.skid()[0])
    new_rover(tmp_path / "rover.urdf")
    (tmp_path / "slope.toml").write_text(text)
    generator.write(tmp_path, **options)
    return tmp_path


def test_it_predicts_what_the_plain_generator_finds(tmp_path):
    bed = SlipSlope.read(folder(tmp_path, repeats=1, sd=0.0))
    model = bed.with_values(bed.base_model(), {"MotionResistance.R": 0.05})
    assert bed.predict([model])[0] == pytest.approx(bed.observed, abs=4e-3)


@pytest.mark.slow
def test_table_without_hidden_effect_needs_none_and_gives_soil(tmp_path):
    set_folder = folder(tmp_path, TOML.replace("31.5", "33.5"))
    conclusion = close_the_loop(set_folder)
    assert conclusion.answer is Answer.NONE_NEEDED, conclusion.summary()
    numbers = {number.name: number for number in conclusion.after.numbers}
    assert numbers["soil.phi"].low < math.radians(31.5) < numbers["soil.phi"].high
    assert conclusion.after.misfit < 1.5


@pytest.mark.nightly
def test_digging_is_found_in_a_sufficiently_fine_table(tmp_path):
    """n + 0.8 S, an SD of 0.003, slips up to 0.57: chi2 falls by 15, and a smooth function may do as well."""
    set_folder = folder(tmp_path, sd=0.003, slopes=(*generator.SLOPES, 16.0, 18.0), digs=0.8)
    conclusion = close_the_loop(set_folder)
    assert conclusion.answer in (Answer.NAMED, Answer.SET, Answer.CANNOT_TELL), conclusion.summary()
    assert next(iter(conclusion.beliefs.included)) == "SlipSinkage"
    sinks = conclusion.beliefs.best(("SlipSinkage",))
    mean, sd = conclusion.beliefs.moments(sinks, "SlipSinkage.n_1")
    number = next(number for number in sinks.parameters if number.name == "SlipSinkage.n_1")
    assert number.value(mean - 2.0 * sd) < 0.8 < number.value(mean + 2.0 * sd)


@pytest.mark.slow
def test_a_slope_that_no_slip_climbs_is_stuck(tmp_path):
    bed = SlipSlope.read(folder(tmp_path, repeats=1))
    steep = np.where(np.isfinite(bed.slopes), math.radians(40.0), np.nan)
    bed = SlipSlope(bed.rover, bed.soil, bed.gravity, bed.folds, steep, bed.observed, bed.sd)
    assert np.all(bed.predict([bed.base_model()])[0] == 1.0)


@pytest.mark.parametrize(
    ("text", "points", "message"),
    [
        (TOML.replace("slip-slope", "slope"), "", "kind = 'slope'"),
        (TOML + "[motor]\nsupply = 1\n", "", "'motor'"),
        (TOML, "run,slope_deg,slip,slip_sd\na,0.2,55,1\n", "not in percent"),
        (TOML, "run,slope_deg,slip,slip_sd\na,95,0.2,0.1\n", "95.*45"),
        (TOML, "run,slope_deg,slip,slip_sd\na,5,0.2,0\n", "slip_sd"),
        (TOML, "run,slope,slip,slip_sd\na,5,0.2,0.1\n", "slope_deg"),
    ],
)
def test_what_is_no_such_table_is_refused_in_one_sentence(tmp_path, text, points, message):
    (tmp_path / "rover.urdf").write_text(generator.field_log.skid()[0])
    new_rover(tmp_path / "rover.urdf")
    (tmp_path / "slope.toml").write_text(text)
    (tmp_path / "points.csv").write_text(points or "run,slope_deg,slip,slip_sd\na,5,0.2,0.1\n")
    with pytest.raises(DataError, match=message) as error:
        SlipSlope.read(tmp_path)
    assert "\n" not in str(error.value)
