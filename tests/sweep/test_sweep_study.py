"""A study's cases, their seeds, and reading one from TOML."""

import dataclasses
import math

import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.sweep import Grid, LatinHypercube, LogRange, Range, Study, Values, read_study

STUDY = Study("trial", "ditch", {"a": Values([1, 2]), "b": Range(0.0, 1.0)}, Grid(3))

TOML = """
name = "trial"
scenario = "ditch"
duration = 20.0
seed = 4
repeats = 2
paired = [["soil.c", "soil.phi"]]
plan = { kind = "grid", points = 3 }
[settings]
gravity = 1.62
rover.name = "nexus6"
terrain.depth = { value = 80, unit = "mm" }
[parameters]
terrain.wall_angle = { low = 20, high = 60, unit = "deg" }
soil.k = { low = 1e-3, high = 1e-1, scale = "log" }
soil.c = [0.0, 100.0]
"soil.phi" = { values = [30, 36], unit = "deg" }
"""


def changed(study, **changes):
    return dataclasses.replace(study, **changes)


def seeds(study):
    return {(*case.values.values(), case.repeat): case.seed for case in study.cases()}


def test_a_seed_comes_from_the_case_and_not_from_its_place():
    more = changed(STUDY, parameters={"a": Values([7, 2, 1]), "b": Range(0.0, 1.0)}, repeats=2, name="more")
    small, large = seeds(STUDY), seeds(more)
    assert len(set(large.values())) == len(large) == 18
    assert small.items() <= large.items()


def test_a_point_drawn_twice_counts_as_a_repeat():
    study = changed(STUDY, parameters={"a": Values([1, 2])}, plan=LatinHypercube(6))
    assert sorted((case.values["a"], case.repeat) for case in study.cases()) == [
        (a, n) for a in (1, 2) for n in range(3)
    ]
    assert len({case.seed for case in study.cases()}) == 6


@pytest.fixture
def write_study(tmp_path):
    def write(text):
        path = tmp_path / "study.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_file_gives_the_study_in_si_units(write_study):
    study = read_study(write_study(TOML))
    assert (study.name, study.scenario, study.duration, study.seed, study.repeats) == ("trial", "ditch", 20.0, 4, 2)
    assert study.plan == Grid(3)
    assert study.paired == (("soil.c", "soil.phi"),)
    assert study.settings == {"gravity": 1.62, "rover.name": "nexus6", "terrain.depth": pytest.approx(0.08)}
    assert list(study.parameters) == ["terrain.wall_angle", "soil.k", "soil.c", "soil.phi"]
    assert study.parameters["terrain.wall_angle"] == Range(20 * math.pi / 180, 60 * math.pi / 180)
    assert study.parameters["soil.k"] == LogRange(1e-3, 1e-1)
    assert study.parameters["soil.phi"].values == pytest.approx((math.pi / 6, math.pi / 5))
    assert len(study.cases()) == 3 * 3 * 2 * 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("duration = 20.0", "durration = 20.0", "'durration':.*'duration'"),
        ('scenario = "ditch"', "", "study.*'scenario'"),
        ('kind = "grid"', 'kind = "gird"', "'gird':.*'grid'"),
        ('kind = "grid", points', "points", "kind"),
        ("points = 3", "cases = 3", "'grid'.*'cases'"),
        ('"grid", points = 3', '"sobol"', "'sobol'.*'cases'"),
        ("low = 20, high = 60", "low = 60, high = 20", r"parameter 'terrain.wall_angle': the range .* is empty"),
        ("low = 20, high = 60", "low = 20, hihg = 60", "'hihg':.*'high'"),
        ("low = 20, high = 60", "low = 20", "range.*'high'"),
        ('"log"', '"lgo"', "'lgo':.*'log'"),
        ('60, unit = "deg"', '60, unit = "degg"', "'degg':.*'deg'"),
        ("low = 20,", 'low = "20",', "'20'.*finite"),
        ("[0.0, 100.0]", "[]", "parameter 'soil.c'"),
        ("[0.0, 100.0]", "5.0", r"'soil.c': 5.0.*\[settings\]"),
        ("values = [30, 36]", "values = 30", "30.*single"),
        ("values = [30, 36]", "values = [30, 36, 37]", "cannot.*together"),
        ('"soil.c", "soil.phi"]]', '"soil.cc", "soil.phi"]]', "'soil.cc'.*'soil.c'"),
        ('["soil.c", "soil.phi"]]', '["soil.c", "soil.phi"], ["soil.c", "soil.k"]]', "'soil.c' 2 times"),
        ('[["soil.c", "soil.phi"]]', "3", "paired = 3"),
        ('value = 80, unit = "mm"', 'value = 80, units = "mm"', "'terrain.depth'.*'units'"),
        ('80, unit = "mm"', '80, unit = "mmm"', "'terrain.depth':.*'mmm'"),
        ("gravity = 1.62", "gravity = [1.62]", r"gravity = \[1.62\]"),
        ("gravity = 1.62", "soil.k = 1.0", "'soil.k'.*parameter"),
        ("duration = 20.0", "duration = -1", "duration = -1.*0"),
        ("duration = 20.0", "dt = true", "dt = True"),
        ("repeats = 2", "repeats = 0", "repeats = 0.*1"),
        ("seed = 4", "seed = 0.5", "seed = 0.5.*0"),
        ('name = "trial"', 'name = "a/b"', "name = 'a/b'"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_in_one_sentence(write_study, old, new, message):
    assert old in TOML
    path = write_study(TOML.replace(old, new, 1))
    with pytest.raises(ParameterError, match=message) as caught:
        read_study(path)
    assert str(caught.value).startswith(str(path))


def test_a_file_that_is_no_study_is_refused(write_study, tmp_path):
    with pytest.raises(DataError, match=r"none.toml:.*cannot"):
        read_study(tmp_path / "none.toml")
    with pytest.raises(DataError, match="is not TOML"):
        read_study(write_study("name = "))
    with pytest.raises(ParameterError, match="parameter"):
        read_study(write_study('name = "a"\nscenario = "b"\nplan = { kind = "grid" }\n[parameters]\n'))
    with pytest.raises(ParameterError, match=r"\[parameters\]"):
        read_study(write_study('name = "a"\nscenario = "b"\nplan = { kind = "grid" }\nparameters = 3\n'))
