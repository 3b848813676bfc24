"""Slip against slope of a whole rover: an experiment beside rig sets and drive logs."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments import slip_slope, soil_priors
from rover_pin.experiments.slip_slope import SlipSlope
from rover_pin.loop.close import close_the_loop
from rover_pin.report.standalone.report import panel
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


def folder(tmp_path, text=TOML, **how):
    (tmp_path / "rover.urdf").write_text(generator.field_log.skid()[0])
    new_rover(tmp_path / "rover.urdf")
    (tmp_path / "slope.toml").write_text(text)
    generator.write(tmp_path, **how)
    return tmp_path


def test_it_predicts_what_the_plain_generator_finds(tmp_path):
    bed = SlipSlope.read(folder(tmp_path, repeats=1, sd=0.0))
    model = bed.with_values(bed.base_model(), {"MotionResistance.R": 0.05})
    assert bed.predict([model])[0] == pytest.approx(bed.observed, abs=4e-3)


def test_table_without_hidden_effect_needs_none_and_gives_soil(tmp_path):
    made = folder(tmp_path, TOML.replace("31.5", "33.5"))
    found = close_the_loop(made)
    assert found.answer is Answer.NONE_NEEDED, found.summary()
    told = {one.name: one for one in found.after.numbers}
    assert told["soil.phi"].low < math.radians(31.5) < told["soil.phi"].high
    assert found.after.misfit < 1.5


@pytest.mark.slow
def test_digging_is_found_in_a_sufficiently_fine_table(tmp_path):
    """n + 0.8 S, an SD of 0.003, slips up to 0.57: chi2 falls by 15, and a smooth function may do as well."""
    made = folder(tmp_path, sd=0.003, slopes=(*generator.SLOPES, 16.0, 18.0), digs=0.8)
    found = close_the_loop(made)
    assert found.answer in (Answer.NAMED, Answer.SET, Answer.CANNOT_TELL), found.summary()
    assert next(iter(found.beliefs.included)) == "SlipSinkage"
    sinks = found.beliefs.best(("SlipSinkage",))
    mean, sd = found.beliefs.moments(sinks, "SlipSinkage.n_1")
    number = next(number for number in sinks.parameters if number.name == "SlipSinkage.n_1")
    assert number.value(mean - 2.0 * sd) < 0.8 < number.value(mean + 2.0 * sd)


def test_its_picture_shows_slip_over_slope(tmp_path):
    """As the table has it, each slip over the slope beside it."""
    made = folder(tmp_path)
    table = np.genfromtxt(made / "points.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    bed = SlipSlope.read(made)
    (axes,) = panel(bed, 0, [], bed.along()).axes
    (measured,) = [line for line in axes.lines if line.get_label() == "measured"]
    drawn = sorted(zip(*measured.get_data(), strict=True))
    assert np.array(drawn) == pytest.approx(np.array(sorted(zip(table["slope_deg"], table["slip"], strict=True))))
    assert axes.get_xlabel() == "slope [deg]"


def test_a_slope_that_no_slip_climbs_is_stuck(tmp_path):
    bed = SlipSlope.read(folder(tmp_path, repeats=1))
    steep = np.where(np.isfinite(bed.slopes), math.radians(40.0), np.nan)
    bed = SlipSlope(bed.rover, bed.soil, bed.gravity, bed.folds, steep, bed.observed, bed.sd)
    assert np.all(bed.predict([bed.base_model()])[0] == 1.0)


def test_too_few_slopes_cannot_tell(tmp_path):
    made = folder(tmp_path)
    rows = (made / "points.csv").read_text().splitlines()
    (made / "points.csv").write_text(
        "\n".join([rows[0], *(row for row in rows if ",0," in row or ",3," in row)]) + "\n"
    )
    found = close_the_loop(made, experiment="slip_slope")
    assert found.answer is Answer.CANNOT_TELL
    assert "2 slopes in 3 runs; measure 4 slopes or more" in found.summary()


@pytest.mark.parametrize("sd", ["0", "-3.0", "'3 deg'", "inf"])
def test_an_uncertainty_that_is_none_is_refused(sd, tmp_path):
    bed = SlipSlope.read(folder(tmp_path, TOML.replace("sd = 3.0", f"sd = {sd}"), repeats=1))
    with pytest.raises(DataError, match=r"the sd of 'phi' is .*: give a positive number in the unit of its value"):
        bed.uncertain(bed.base_model())


PAGE = Path(__file__).parents[2] / "docs" / "data-slip-slope.md"


def test_the_page_says_what_is_read(tmp_path):
    """Its description is read, and its columns, bounds and assumed SDs are those of the reader."""
    said = PAGE.read_text(encoding="utf-8")
    made = folder(tmp_path, re.findall(r"```toml\n(.*?)```", said, re.DOTALL)[0], repeats=1)
    assert SlipSlope.read(made).soil.phi == pytest.approx(math.radians(34.0))
    assert tuple(re.findall(r"^\| `(\w+)` \|", said, re.MULTILINE)) == ("run", *slip_slope.COLUMNS)
    assert slip_slope.FEWEST == 4
    assert "Four slopes or more, in two runs or more" in said
    numbers = re.search(r"within (\d+) deg \(phi\), (\d+) % \(k,\s+k_1\) or (\d+) % of the\s+load \(R\)", said).groups()
    phi, k, k_1 = (soil_priors.SD[name].undeclared for name in ("phi", "k", "k_1"))
    assert k == k_1
    assert [int(each) for each in numbers] == [round(math.degrees(phi)), 100 * k, 100 * slip_slope.R_SD]


@pytest.mark.parametrize(
    ("text", "points", "said"),
    [
        (TOML.replace("slip-slope", "slope"), "", "kind = 'slope'"),
        (TOML + "[motor]\nsupply = 1\n", "", "there is no key 'motor'"),
        (TOML, "run,slope_deg,slip,slip_sd\na,0.2,55,1\n", "not percent"),
        (TOML, "run,slope_deg,slip,slip_sd\na,95,0.2,0.1\n", "give degrees, within 45"),
        (TOML, "run,slope_deg,slip,slip_sd\na,5,0.2,0\n", "slip_sd must be above 0"),
        (TOML, "run,slope,slip,slip_sd\na,5,0.2,0.1\n", "slope_deg"),
    ],
)
def test_what_is_no_such_table_is_refused_in_one_sentence(tmp_path, text, points, said):
    made = folder(tmp_path, text, repeats=1)
    if points:
        (made / "points.csv").write_text(points)
    with pytest.raises(DataError, match=said) as error:
        SlipSlope.read(made)
    assert "\n" not in str(error.value)
