"""What the page says that the loop finds on the measured wheels is what it finds."""

import re
from pathlib import Path

import pytest

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.conclude import side_of
from rover_pin.loop.close import close_the_loop

ROOT = Path(__file__).parents[2]
DATA = ROOT / "studies" / "data"
PAGE = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
UNITS = {"drawbar pull": 1.0, "sinkage": 1e-3, "side force": 1.0}


def told(data):
    """The answer and the errors of a row of the page's table: pull [N], sinkage [mm] (, side force [N])."""
    (row,) = re.findall(rf"^\| {data} \| (.*) \| ([\d. /,]+) \|$", PAGE, re.MULTILINE)
    return row[0], [[float(each) for each in one.split(" / ")] for one in row[1].split(", ")]


def in_the_pages_units(errors):
    return [errors[name] / unit for name, unit in UNITS.items() if name in errors]


def held_out(verdict):
    return in_the_pages_units({one.name: one.after for one in verdict.scores})


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("data", "folder", "named"),
    [
        ("smooth wheel", "cmu-smooth-wheel", {"SlipSoftening"}),
        ("lugged wheel", "cmu-grousered-wheel", {"SlipSinkage", "RateDependence"}),
        ("braked wheel", "cmu-smooth-wheel-skid", {"Ploughing"}),
        ("at slip angles", "cmu-smooth-wheel-angles", {"SlipSoftening", "FlankPressure", "RateDependence"}),
    ],
)
def test_the_loop_on_a_measured_wheel_is_as_told(data, folder, named):
    answer, (errors,) = told(data)
    verdict = close_the_loop(DATA / folder)
    assert set(verdict.named) == named
    assert held_out(verdict) == pytest.approx(errors, abs=0.0051)
    same = sum(set(one.split(" + ")) == named for one in verdict.chosen.values())
    for count, folds in re.findall(r"(\d+) of (\d+) folds", answer):
        assert (same, len(verdict.chosen)) == (int(count), int(folds))
    for each in re.findall(r"own choice ([\d.]+ / [\d.]+)", answer):
        anew = in_the_pages_units(verdict.errors_anew)
        assert anew == pytest.approx([float(one) for one in each.split(" / ")], abs=0.0051)
    for each in re.findall(r"\(([\d.]+ / [\d.]+)\)", answer):
        (other,) = verdict.others.values()
        assert in_the_pages_units(other) == pytest.approx([float(one) for one in each.split(" / ")], abs=0.0051)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("folder", "said"), [("cmu-grousered-wheel", "here"), ("cmu-smooth-wheel-angles", "at slip angles")]
)
def test_the_speed_that_scales_the_rate_is_as_told(folder, said):
    (told_of_it,) = re.findall(rf"(\d+) mm/s \[([\d.]+), (\d+)\] {said}", PAGE)
    (speed,) = [one for one in close_the_loop(DATA / folder).after.numbers if one.name == "RateDependence.v_0"]
    found = [1e3 * one for one in (speed.value, speed.low, speed.high)]
    assert found == pytest.approx([float(one) for one in told_of_it], rel=0.03, abs=0.51)


@pytest.mark.nightly
def test_page_states_the_lugged_pull_and_softening_at_held_speed(monkeypatch):
    pull, same, count = re.findall(r"leaves a pull of ([\d.]+) N, chosen in (\d) of (\d) folds", PAGE)[0]
    left = re.findall(r"reduced chi-square of ([\d.]+), the exponent ([\d.]+)\.", PAGE)[0]
    free = close_the_loop(DATA / "cmu-grousered-wheel")
    other = side_of(free.beliefs, free.beliefs.best(("SlipSoftening", "RateDependence")))
    assert [other.misfit, free.after.misfit] == pytest.approx([float(one) for one in left], abs=0.051)
    about = Candidate._about
    monkeypatch.setattr(Candidate, "_about", lambda self, name: about(self, name)._replace(log_sd=0.0))
    held = close_the_loop(DATA / "cmu-grousered-wheel")
    assert held.named == free.named
    assert held_out(held)[0] == pytest.approx(float(pull), abs=0.0051)
    chosen = [set(one.split(" + ")) == set(held.named) for one in held.chosen.values()]
    assert (sum(chosen), len(chosen)) == (int(same), int(count))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("data", "folders", "named"),
    [
        (
            "smooth and braked wheel together",
            ("cmu-smooth-wheel", "cmu-smooth-wheel-skid"),
            {"Ploughing", "SlipSoftening"},
        ),
        (
            "smooth and lugged wheel together",
            ("cmu-smooth-wheel", "cmu-grousered-wheel"),
            {"SlipSinkage", "InterfaceFriction"},
        ),
    ],
)
def test_the_loop_on_two_measured_wheels_is_as_told(data, folders, named):
    answer, errors = told(data)
    verdict = close_the_loop(tuple(DATA / folder for folder in folders))
    assert set(verdict.named) == named
    by_set = [[each for each in verdict.extra.sets if each.set == folder] for folder in folders]
    found = [in_the_pages_units({one.channel: one.after for one in each}) for each in by_set]
    for own, page in zip(found, errors, strict=True):
        assert own == pytest.approx(page, abs=0.0051)
    for both in re.findall(r"both signs ([\d.]+ / [\d.]+)", answer):
        assert held_out(verdict) == pytest.approx([float(one) for one in both.split(" / ")], abs=0.0051)
