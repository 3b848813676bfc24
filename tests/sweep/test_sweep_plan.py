"""Plans visit what they say they visit."""

import math
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.sweep import Grid, LatinHypercube, LogRange, Range, Sobol, Study, Values
from rover_pin.sweep.plan import MAX_CASES

ANGLE = {"terrain.wall_angle": Range(10.0, 60.0)}
SHEAR = {"soil.k": LogRange(1e-3, 1e-1)}
SOIL = {"soil.name": Values(["dry-sand", "table-1"])}


def test_grid_has_every_combination_last_parameter_fastest():
    points = Grid(points=3).choose([ANGLE, SOIL], seed=0)
    assert points[0] == {"terrain.wall_angle": 10.0, "soil.name": "dry-sand"}
    assert points[1] == {"terrain.wall_angle": 10.0, "soil.name": "table-1"}
    assert [point["terrain.wall_angle"] for point in points[::2]] == [10.0, 35.0, 60.0]


@given(cases=st.integers(1, 40), seed=st.integers(0, 2**32))
def test_latin_hypercube_samples_each_stratum_once(cases, seed):
    points = LatinHypercube(cases).choose([ANGLE, SHEAR], seed)
    parts = sorted(int((point["terrain.wall_angle"] - 10.0) / 50.0 * cases) for point in points)
    decades = sorted(int(math.log10(point["soil.k"] / 1e-3) / 2.0 * cases) for point in points)
    assert parts == decades == list(range(cases))


@pytest.mark.parametrize("plan", [LatinHypercube(16), Sobol(16)])
def test_drawn_plans_depend_on_the_seed_only(plan):
    groups = [ANGLE, SHEAR, SOIL]
    assert plan.choose(groups, 1) == plan.choose(groups, 1)
    assert plan.choose(groups, 1) != plan.choose(groups, 2)
    assert Counter(point["soil.name"] for point in plan.choose(groups, 1)) == {"dry-sand": 8, "table-1": 8}


@given(share=st.floats(0.0, 1.0), low=st.floats(1e-6, 1.0), factor=st.floats(1.001, 1e6))
def test_ranges_stay_within_their_ends(share, low, factor):
    for axis in (Range(-low, low * factor), LogRange(low, low * factor)):
        assert axis.low <= axis.at(share) <= axis.high
        assert (axis.at(0.0), axis.at(1.0)) == (axis.low, axis.high)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Range(60.0, 10.0), "range.*60.*10"),
        (lambda: Range(1.0, 1.0), "is empty"),
        (lambda: Range(math.nan, 1.0), "low = nan"),
        (lambda: Range(0.0, "1"), "high = '1'.*allowed"),
        (lambda: LogRange(0.0, 1.0), "low = 0.*logarithmic.*0"),
        (lambda: Values([]), "values.*empty"),
        (lambda: Values([1.0, "a"]), "only finite numbers"),
        (lambda: Values([1.0, math.inf]), "only finite numbers"),
        (lambda: Values([1.0, 1]), "twice:.*repeats"),
        (lambda: Values("table-1"), "'table-1'"),
        (lambda: Grid(points=1), "points = 1.*2"),
        (lambda: LatinHypercube(0), "cases = 0.*1"),
        (lambda: Sobol(2.5), "cases = 2.5"),
        (lambda: Sobol(100), "cases = 100.*64.*128"),
        (lambda: Grid(10).choose([{str(i): Range(0.0, 1.0)} for i in range(8)], 0), f"more than {MAX_CASES}"),
        (lambda: Study("a", "flat", {"x": Values([1.0, 2.0])}, Grid(), repeats=MAX_CASES).cases(), "repeats = .* more"),
    ],
)
def test_what_is_no_plan_is_refused_in_one_sentence(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
