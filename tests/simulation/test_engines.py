"""The engines of a drive: whole drives with Pinocchio's own algorithms equal drives with the compiled step."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, RoverPinError, load_rover, scenario, simulate
from rover_pin.base.errors import ParameterError, UnknownNameError
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.rover.description.layout import rover_folder
from rover_pin.scenarios.scenes import SCENES
from rover_pin.simulation.engines import COMPILED, ENGINES
from rover_pin.simulation.model.defaults import scale
from rover_pin.simulation.start import settled_state
from rover_pin.terrain.files import to_grid
from rover_pin.terrain.terrain import HeightGrid

ROVERS = sorted(file.stem for file in rover_folder().glob("*.toml"))
REFERENCES = [name for name in ENGINES if name != COMPILED]
QUICK = {("nexus6", "ditch"), ("cart", "bump"), ("nexus6_links", "turn")}
SPREAD = {
    ("nexus6", "step"), ("nexus6", "grid"), ("nexus6", "crab"), ("nexus6", "park"), ("cart", "hills"),
    ("cart", "polyline"), ("cart", "point-turn"), ("nexus6_links", "washboard"), ("nexus6_links", "cross-slope"),
}  # fmt: skip
"""Pairs that the everyday run and the slow run drive; the nightly run drives every rover in every scenario."""
ROUND_OFF = 1e-11
"""Largest difference of a channel, over its largest value or 1. Measured: below 1e-12."""


def pairs():
    """Return every rover in every scenario, except the cart in `crab`, because none of its wheels steers."""
    marks = {pair: () for pair in QUICK} | dict.fromkeys(SPREAD, pytest.mark.slow)
    every = [(rover, scene) for rover in ROVERS for scene in SCENES if (rover, scene) != ("cart", "crab")]
    return [pytest.param(*pair, marks=marks.get(pair, pytest.mark.nightly)) for pair in every]


def drives(made, **options):
    """Return the traces of all engines; the compiled engine comes first."""
    return [made.drive(measure_error=False, engine=engine, **options) for engine in ENGINES]


def difference(trace, reference):
    """Return the largest difference of any channel, over the channel's largest value or 1, and the channel's name."""
    assert list(trace.channels) == list(reference.channels)
    worst = 0.0, ""
    for name, values in reference.channels.items():
        assert np.array_equal(np.isnan(values), np.isnan(trace[name])), name
        known = values[np.isfinite(values)]
        if known.size:
            size = max(1.0, float(np.abs(known).max()))
            worst = max(worst, (float(np.nanmax(np.abs(trace[name] - values))) / size, name))
    return worst


def own_ground(scene, folder):
    """Return settings with a custom terrain for the scenarios that need one: a sill and a wave across the path."""
    if scene == "polyline":
        (folder / "t.csv").write_text("x_m,z_m\n-9,0\n1.1,0\n1.2,0.03\n1.6,0.03\n1.7,0\n9,0\n")
        return {"terrain.path": str(folder / "t.csv")}
    if scene == "grid":
        x = y = np.linspace(-3.0, 3.0, 121)
        z = 0.04 * np.sin(3.0 * x)[:, None] * np.cos(2.0 * y)
        return {"terrain.path": str(to_grid(folder / "t.npz", HeightGrid(x[0], y[0], 0.05, 0.05, z)))}
    return {}


@pytest.mark.parametrize(("rover", "scene"), pairs())
def test_every_engine_drives_alike(rover, scene, tmp_path):
    """The drive starts where the front wheels touch the obstacle."""
    settings = {"rover": rover, "start.x": 0.42 * scale(load_rover(rover)), **own_ground(scene, tmp_path)}
    made = scenario(scene, **settings, duration=0.2 if (rover, scene) in QUICK else 0.5)
    compiled, *others = drives(made)
    assert "engine" not in compiled.attrs
    for name, trace in zip(REFERENCES, others, strict=True):
        assert trace.attrs["engine"] == trace.summary()["engine"] == name
        assert {key: value for key, value in trace.attrs.items() if key != "engine"}.keys() == compiled.attrs.keys()
        assert (trace.attrs["stop"], trace.attrs["set_down"]) == (compiled.attrs["stop"], compiled.attrs["set_down"])
        worst, channel = difference(trace, compiled)
        assert worst < ROUND_OFF, channel


@pytest.mark.parametrize("control", ["eq9", "onboard", "tracked"])
def test_sensors_and_slip_control_run_in_every_engine(control):
    made = scenario("flat", control=control, duration=0.3)
    compiled, *others = drives(made)
    assert len(np.unique(compiled.stack("duty"))) > 2, "the control does nothing here"
    assert max(difference(trace, compiled) for trace in others)[0] < ROUND_OFF


def test_effects_with_states_run_in_every_engine():
    flat = scenario("one-sided-bump", duration=0.25, **{"start.x": 0.42})
    made = flat.model
    for effect in (DiggingMemory(c_d=0.05), MultiPass(), SupplySag(), DifferentialCompliance()):
        made = made.having(effect)
    compiled, *others = drives(dataclasses.replace(flat, model=made))
    assert np.abs(compiled["differential_torque"]).max() > 1e-3
    assert max(difference(trace, compiled) for trace in others)[0] < ROUND_OFF


def test_a_drive_goes_on_in_another_engine():
    made = scenario("turn", duration=0.3)
    options = {"timing": made.timing, "measure_error": False}
    whole = simulate(made.model, made.controller, 0.3, **options)
    for engine in REFERENCES:
        part = simulate(made.model, made.controller, 0.15, **options)
        rest = simulate(made.model, made.controller, 0.15, part.end, **options, engine=engine)
        assert rest.attrs["engine"] == engine
        for name in whole.channels:
            joined = np.append(part[name], rest[name])
            assert joined == pytest.approx(whole[name], abs=1e-10, rel=1e-10, nan_ok=True), name


def test_an_unknown_engine_is_refused():
    flat = scenario("flat").model
    with pytest.raises(UnknownNameError, match="pinocchio-aba"):
        simulate(flat, ConstantDuty(), 0.1, engine="pinocchio-abba")
    with pytest.raises(RoverPinError, match="engine"):
        simulate(flat, ConstantDuty(), 0.1, engine=3)


def sliding_rover(made):
    """Return the model's rover with bogies that slide up and down instead of turning; everything else is unchanged."""
    rover = made.rover
    bogies = [rover.angles[name] for name in ("bogie_l", "bogie_r")]
    model, old = pin.Model(), rover.model
    for i in range(1, old.njoints):
        joint = pin.JointModelPZ() if old.joints[i].idx_q in bogies else old.joints[i]
        model.addJoint(old.parents[i], joint, old.jointPlacements[i], old.names[i])
        model.appendBodyToJoint(i, old.inertias[i], pin.SE3.Identity())
    model.lowerPositionLimit, model.upperPositionLimit = old.lowerPositionLimit, old.upperPositionLimit
    model.gravity = old.gravity
    return dataclasses.replace(rover, model=model)


def test_a_joint_that_the_recursion_does_not_know_needs_pinocchio():
    """Both algorithms of Pinocchio agree for this joint, the energy balances, and the error of the compiled engine
    names these two engines.
    """
    made = scenario("flat").model
    state = settled_state(made, scenario("flat").start)
    slides = dataclasses.replace(made, rover=sliding_rover(made))
    # Compiled code sets the rover down for every engine.
    refused = [(state, COMPILED), *((scenario("flat").start, engine) for engine in ENGINES)]
    for begin, engine in refused:
        with pytest.raises(ParameterError, match=r"bogie.*JointModelPZ.*pinocchio-crba.*pinocchio-aba"):
            simulate(slides, ConstantDuty(), 0.1, begin, engine=engine)
    crba, aba = (
        simulate(slides, ConstantDuty(), 0.1, state, measure_error=False, engine=engine) for engine in REFERENCES
    )
    assert np.ptp(crba["bogie_l"]) > 0.02, "the bogies slide too little for a test"
    assert difference(aba, crba)[0] < ROUND_OFF
    assert crba.energy_error() < 1e-3


def test_another_base_needs_pinocchio_too():
    made = scenario("flat").model
    state, moved = settled_state(made, scenario("flat").start), made.rover.model.copy()
    moved.jointPlacements[1] = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
    with pytest.raises(ParameterError, match=r"base.*origin.*pinocchio-crba"):
        simulate(
            dataclasses.replace(made, rover=dataclasses.replace(made.rover, model=moved)), ConstantDuty(), 0.1, state
        )
