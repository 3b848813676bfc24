"""Ordinary mistakes in Python, from an empty folder: each is one sentence that names it."""

import math

import numpy as np
import pytest
from casadi import SX

from rover_pin import (
    SOILS,
    ConstantDuty,
    Model,
    Motor,
    RoverPinError,
    SlipControl,
    Soil,
    Trace,
    Wheel,
    close_the_loop,
    load_rover,
    load_traction_factor,
    scenario,
    simulate,
    torque_bounds,
    wheel_forces,
)
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.simulation.start import Start

SAND, WHEEL = Soil(), Wheel()


@pytest.fixture(scope="module")
def flat():
    return scenario("flat", duration=0.2)


def steady(reading):
    return 0.4


CALLS = {  # what names the mistake in the sentence -> the call
    "missing a required argument: 'name'": lambda flat: scenario(),
    "name = 3": lambda flat: scenario(3),
    "name = ['flat']": lambda flat: scenario(["flat"]),
    "'dicth'": lambda flat: scenario("dicth"),
    "soil = 3": lambda flat: scenario("flat", soil=3),
    "soil = {'k': 0.01}": lambda flat: scenario("flat", soil={"k": 0.01}),
    "'soil_k'": lambda flat: scenario("flat", soil_k=0.01),
    "soil.k = 10 m": lambda flat: scenario("flat", **{"soil.k": "10m"}),
    "soil.phi = 30 rad": lambda flat: scenario("flat", **{"soil.phi": 30}),
    "motor = 12": lambda flat: scenario("flat", motor=12),
    "rover = None": lambda flat: scenario("flat", rover=None),
    "rover = 6 ": lambda flat: scenario("flat", rover=6),
    "model = Model(": lambda flat: scenario("flat", model=flat.model),
    "control = 0.4": lambda flat: scenario("flat", control=0.4),
    "control = <class": lambda flat: scenario("flat", control=ConstantDuty),
    "control = <function no_reading": lambda flat: scenario("flat", control=no_reading),
    "control.delta = 55": lambda flat: scenario("flat", **{"control.delta": 55}),
    "duration = -1 s": lambda flat: scenario("flat", duration=-1),
    "duration = 'long'": lambda flat: scenario("flat", duration="long"),
    "duration: None": lambda flat: scenario("flat", duration=None),
    "duration: True": lambda flat: scenario("flat", duration=True),
    "gravity = 'venus'": lambda flat: scenario("flat", gravity="venus"),
    "gravity = 500": lambda flat: scenario("flat", gravity=500),
    "<class 'rover_pin.effects.slip_sinkage.SlipSinkage'>": lambda flat: scenario("flat", add=SlipSinkage),
    "progress = 3": lambda flat: flat.drive(3),
    "trace = 3": lambda flat: flat.write_log(3, "log"),
    "model = Scenario(": lambda flat: simulate(flat, steady, 1.0),
    "controller = None": lambda flat: simulate(flat.model, None, 1.0),
    "duration = '1 s'": lambda flat: simulate(flat.model, steady, "1 s"),
    "the duty 55": lambda flat: simulate(flat.model, lambda reading: 55, 1.0),
    "the duty None": lambda flat: simulate(flat.model, lambda reading: None, 1.0),
    "the duty 'fast'": lambda flat: simulate(flat.model, lambda reading: "fast", 1.0),
    "no 'speed'": lambda flat: simulate(flat.model, steady, 1.0, speed=3),
    "argument: 'controller'": lambda flat: simulate(flat.model),
    "rover = 6": lambda flat: load_rover(6),
    "rover 'nexus7'": lambda flat: load_rover("nexus7"),
    "'kk'": lambda flat: Soil(kk=0.01),
    "k = 10 m": lambda flat: Soil(k=10),
    "does not fit": lambda flat: Soil(phi="30 m"),
    "r = 'large'": lambda flat: Wheel(r="large"),
    "supply = None": lambda flat: Motor(supply=None),
    "delta = 55": lambda flat: ConstantDuty(55),
    "'gamma'": lambda flat: SlipSinkage(gamma=3.0),
    "'moon-dust'": lambda flat: SOILS["moon-dust"],
    "'sand'": lambda flat: SAND.replace(sand=3),
    "gains = 0.1": lambda flat: SlipControl(0.1, None),
    "S = '0.2'": lambda flat: load_traction_factor("0.2", SAND, WHEEL),
    "S is an array": lambda flat: load_traction_factor(np.linspace(0.0, 1.0, 5), SAND.replace(k=SX.sym("k")), WHEEL),
    "soil = Wheel(": lambda flat: load_traction_factor(0.2, WHEEL, SAND),
    "form = 'nett'": lambda flat: load_traction_factor(0.2, SAND, WHEEL, "nett"),
    "soil = 'table-1'": lambda flat: torque_bounds(9.5, "table-1", WHEEL),
    "argument: 'soil'": lambda flat: wheel_forces(0.2, 0.6, -0.1, WHEEL),
    "argument: 'rover'": lambda flat: Model(),
    "soils = Soil(": lambda flat: flat.model.replace(soils=SAND),
    "gravity = 'moon'": lambda flat: flat.model.replace(gravity="moon"),
    "'sand' ": lambda flat: flat.model.replace(sand=SAND),
    "effect = 'SlipSinkage'": lambda flat: flat.model.having("SlipSinkage"),
    "kind = SlipSinkage(": lambda flat: flat.model.without(SlipSinkage()),
    "no channel 'body_w'": lambda flat: Trace({"t_s": [0.0, 1.0]})["body_w"],
    "channels are no dict": lambda flat: Trace([0.0, 1.0]),
    "'zero'": lambda flat: Trace({"t_s": ["zero", "one"]}),
    "data = 3": lambda flat: close_the_loop(3),
    "gone: ": lambda flat: close_the_loop("gone"),
    "jobs = 'all'": lambda flat: close_the_loop("cmu-smooth-wheel", jobs="all"),
}  # fmt: skip


def no_reading():
    return 0.4


@pytest.mark.parametrize(("named", "call"), CALLS.items(), ids=list(CALLS))
def test_a_mistake_in_python_is_named_in_a_sentence(flat, run, named, call):
    with pytest.raises(RoverPinError) as refusal:
        call(flat)
    assert named.strip() in str(refusal.value)
    assert len(str(refusal.value)) < 700


def test_a_soil_a_motor_and_a_start_in_memory_are_driven(run):
    sand, motor = Soil(k=0.01, c=300.0), Motor(supply=8.4)
    case = scenario("flat", soil=sand, motor=motor, start=Start(x=0.3), duration=0.2)
    assert (case.model.soils[0], case.model.motor, case.start) == (sand, motor, Start(x=0.3))
    trace = case.drive()
    case.write_log(trace, "log")
    again = scenario("flat", **trace.attrs["settings"])
    assert (again.model.soils, again.model.motor, again.start) == (case.model.soils, motor, case.start)
    assert scenario("flat", soil=sand, **{"soil.k": "20mm"}).model.soils[0] == sand.replace(k=0.02)


def test_a_function_is_a_controller(run):
    case = scenario("flat", control=steady, duration=0.3)
    trace = case.drive()
    assert trace["duty_fl"].tolist() == [0.4] * len(trace.t)
    assert (trace.attrs["control"], "control" in trace.attrs["settings"]) == ("steady", False)
    case.write_log(trace, "log")
    driven = scenario("flat", control=ConstantDuty(0.3), duration=0.3).drive()
    assert driven["duty_fl"].max() == pytest.approx(0.3)


def test_units_are_read_alike_by_options_settings_and_python(run):
    def bounds(*words):
        code, out, _ = run("bounds", *words, "--json")
        assert code == 0
        return out

    assert bounds("--slope-deg", "5deg", "--gravity", "1.62m/s2", "--slip", "20%") == bounds(
        "--slope-deg", "5", "--gravity", "1.62", "--slip", "0.2"
    )
    assert bounds("--slope-deg", f"{math.radians(5.0)!r}rad", "--gravity", "162 cm/s²") == bounds(
        "--slope-deg", "5", "--gravity", "moon"
    )
    options = "identify", "cmu-smooth-wheel", "--json"
    by_degrees, by_radians = (
        run(*options, "--prior", f"phi={mean}:{sd}")
        for mean, sd in (("30deg", "2deg"), (math.radians(30.0), math.radians(2.0)))
    )
    assert by_degrees[0] == 0
    assert by_degrees[1] == by_radians[1]
