"""What one door takes, its siblings take: objects in memory, arrays, words, numbers with their units, other names."""

import copy
import math
import pickle

import numpy as np
import pytest

from rover_pin import SOILS, Soil, Wheel, load_rover, load_traction_factor, scenario
from rover_pin.base.errors import ParameterError, RoverPinError, UnknownAttributeError
from rover_pin.contact import Load
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.simulation.command import Reading
from rover_pin.terrain.files import from_grid
from rover_pin.terrain.shapes import hills

SAND = SOILS["table-1"]


@pytest.fixture(scope="module")
def trace():
    return scenario("flat", duration=0.3).drive(measure_error=False)


@pytest.mark.parametrize("form", ["net", "torque", "gross"])
@pytest.mark.parametrize("angles", ["fixed", "sinkage"])
def test_the_traction_factor_takes_the_words_of_settings_and_arrays(form, angles):
    slips = np.array([[-0.5, 0.0, 0.2], [0.5, 0.9, 1.0]])
    factors = load_traction_factor(slips, SAND, Wheel(), form, angles)
    single = [load_traction_factor(float(slip), SAND, Wheel(), form, angles) for slip in slips.ravel()]
    assert factors.shape == slips.shape
    assert factors.ravel() == pytest.approx(single, rel=1e-12, abs=1e-14)
    assert load_traction_factor(list(slips[0]), SAND, Wheel(), form, angles) == pytest.approx(single[:3])


@pytest.mark.parametrize("keywords", [{"form": "nett"}, {"angles": "fix"}])
def test_an_unknown_word_of_the_traction_factor_is_refused(keywords):
    with pytest.raises(ParameterError, match="did you mean"):
        load_traction_factor(0.2, SAND, Wheel(), **keywords)


@pytest.mark.parametrize(("fields", "value"), [({"phi": "33deg"}, math.radians(33.0)), ({"k": "8 mm"}, 0.008),
                                               ({"c": "1.2 kPa"}, 1200.0), ({"n": "1.1"}, 1.1)])  # fmt: skip
def test_a_record_takes_a_number_with_its_unit(fields, value):
    (name,) = fields
    assert getattr(Soil(**fields), name) == pytest.approx(value)
    assert getattr(SAND.replace(**fields), name) == pytest.approx(value)
    assert getattr(scenario("flat", **{f"soil.{name}": fields[name]}).model.soils[0], name) == pytest.approx(value)


@pytest.mark.parametrize("fields", [{"phi": "80deg"}, {"phi": "33 mm"}, {"phi": "steep"}])
def test_a_record_refuses_a_text_that_is_no_such_number(fields):
    with pytest.raises(ParameterError, match=r"Soil\.phi"):
        Soil(**fields)


def test_an_effect_takes_a_number_with_its_unit():
    assert DiggingMemory(length="5cm").length == pytest.approx(0.05)


def test_a_rover_in_memory_drives_as_its_name_does(tmp_path):
    by_name, in_memory = (scenario("flat", rover=rover, duration=0.3) for rover in ("cart", load_rover("cart")))
    traces = [ready.drive(measure_error=False) for ready in (by_name, in_memory)]
    assert np.array_equal(traces[0]["body_x"], traces[1]["body_x"])
    in_memory.write_log(traces[1], tmp_path / "log")
    heavy = scenario("flat", rover=load_rover("cart").carrying(2.0), duration=0.3)
    heavy_trace = heavy.drive(measure_error=False)
    assert heavy_trace["normal_fl"][-1] > traces[0]["normal_fl"][-1] + 1.0
    with pytest.raises(ParameterError, match="'cart'"):
        heavy.write_log(heavy_trace, tmp_path / "heavy")


def test_an_array_of_heights_is_the_ground_that_its_file_is(tmp_path):
    x, y = np.meshgrid(np.arange(60) * 0.1, np.arange(40) * 0.1)
    heights = 0.02 * np.sin(2.0 * x) * np.cos(1.5 * y) + 0.01 * x
    np.save(tmp_path / "dem.npy", heights)
    terrain = scenario("grid", terrain=heights, **{"terrain.cell": "10cm"}).model.terrain
    assert terrain == from_grid(tmp_path / "dem.npy", cell=0.1)
    # By hand: the array's first row lies in the north (+y), columns go along x, the lowest height is 0.
    north_west = float(heights[0, 0] - heights.min())
    assert float(terrain.height(-0.5 * 5.9, 0.5 * 3.9)) == pytest.approx(north_west, abs=1e-9)
    assert scenario("flat", terrain=hills()).model.terrain == hills()


@pytest.mark.parametrize(("terrain", "more"), [(np.zeros((9, 9)), {}), (np.zeros(9), {"terrain.cell": 0.1}),
                                               ("dem.npy", {}), (np.zeros((9, 9)), {"terrain.cell": -1.0}),
                                               ])  # fmt: skip
def test_a_terrain_that_is_none_is_refused(terrain, more):
    with pytest.raises(RoverPinError, match="terrain"):
        scenario("grid", terrain=terrain, **more)


def test_bekker_constants_as_settings_are_converted_for_the_wheel():
    """By hand: k_1 = k_c b^(n-1), k_2 = k_phi b^(n-1), b of Nexus 6 50 mm."""
    settings = {"soil.k_c": "0.99 kN/m^(n+1)", "soil.k_phi": "1528.43kN/m^(n+2)", "soil.n": 1.1}
    soil = scenario("flat", **settings).model.soils[0]
    assert float(soil.k_1) == pytest.approx(990.0 * 0.05**0.1)
    assert float(soil.k_2) == pytest.approx(1528430.0 * 0.05**0.1)
    with pytest.raises(ParameterError, match="k_c needs k_phi and n"):
        scenario("flat", **{"soil.k_c": 990.0})


@pytest.mark.parametrize(("wrong", "right"), [("slip_ml", "trace['slip_ml']"), ("slip", "trace.stack('slip')"),
                                              ("bodyx", "'body_x'")])  # fmt: skip
def test_an_attribute_that_a_trace_has_not_names_the_channel(trace, wrong, right):
    with pytest.raises(UnknownAttributeError, match=right.replace("[", r"\[").replace("(", r"\(").replace(")", r"\)")):
        getattr(trace, wrong)


def test_other_objects_name_the_right_attribute_as_well(trace):
    for thing, wrong, right in (
        (Load(), "f_z", "'f_n'"),
        (SAND, "friction_angle", "'phi'"),
        (Wheel(), "radius", "'r'"),
    ):
        with pytest.raises(UnknownAttributeError, match=right):
            getattr(thing, wrong)
    names_asked = []

    def controller(reading: Reading) -> float:
        with pytest.raises(UnknownAttributeError, match=r"reading\.truth\.slip"):
            reading.slip  # noqa: B018
        names_asked.append(float(reading.truth.slip[0]))
        return 0.3

    scenario("flat", control=controller, duration=0.2).drive(measure_error=False)
    assert names_asked
    for probed in (trace, SAND, Load()):
        assert not hasattr(probed, "no_such_name")
        assert not hasattr(probed, "__array__")
        assert type(copy.deepcopy(probed)) is type(probed)
    assert pickle.loads(pickle.dumps(SAND)) == SAND


def test_an_attribute_error_crosses_processes_with_its_message():
    with pytest.raises(UnknownAttributeError) as refused:
        Load().f_z  # noqa: B018
    assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)


@pytest.mark.parametrize(
    ("wrong", "right"), [("cohesion", "'c'"), ("friction_angle", "'phi'"), ("k_c", r"k_c b\^\(n-1\)")]
)
def test_names_that_others_give_are_hinted_at(wrong, right):
    with pytest.raises(ParameterError, match=right):
        Soil(**{wrong: 1.0})
    if wrong != "k_c":
        with pytest.raises(ParameterError, match=right.replace("'", "", 1).replace("'", "")):
            scenario("flat", **{f"soil.{wrong}": 1.0})
