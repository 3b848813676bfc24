"""FMI 3.0 units in another program: fmpy validates, instantiates and steps them, alone and in a closed loop."""

import re
import shutil
import zipfile

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin import scenario
from rover_pin.cli.app import app
from rover_pin.control.design.stepped import SteppedDrive
from rover_pin.onboard.embedded.source import embed
from rover_pin.onboard.embedded.vectors import vectors
from rover_pin.onboard.fmi.controller import unit_of
from rover_pin.onboard.fmi.plant import plant
from rover_pin.onboard.fmi.unit import write_unit
from rover_pin.simulation.command import Command
from tests.onboard.fmi.standalone import PERIODS, ran_sanely

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
PERIOD = 0.05


class Opened:
    """A functional mock-up unit that fmpy has loaded, with access to its variables by name."""

    def __init__(self, path):
        self.path = path
        self.description = fmpy.read_model_description(str(path))
        self.folder = fmpy.extract(str(path))
        self.of = {variable.name: variable for variable in self.description.modelVariables}
        self.unit = self.another()
        self.k = 0

    def another(self):
        unit = fmpy.instantiate_fmu(self.folder, self.description, "CoSimulation")
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        return unit

    def __getitem__(self, name):
        variable = self.of[name]
        count = int(variable.dimensions[0].start) if variable.dimensions else 1
        return np.array(self.unit.getFloat64([variable.valueReference], count))

    def __setitem__(self, name, values):
        self.unit.setFloat64([self.of[name].valueReference], np.atleast_1d(values).tolist())

    def step(self, periods=1):
        result = self.unit.doStep(self.k * PERIOD, periods * PERIOD)
        self.k += periods
        return result


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """Return a function that writes and loads the unit of a rover in a scenario, or the unit of a control for this
    rover.
    """
    folders = []

    def write(scene, control="", **settings):
        chosen = scenario(scene, **({"control": control} if control else {}), **settings)
        fmu = unit_of(chosen.controller, chosen.model) if control else plant(chosen.model, chosen.start, chosen.timing)
        unit = Opened(write_unit(fmu, tmp_path_factory.mktemp("fmu") / f"{fmu.name}.fmu"))
        folders.append(unit.folder)
        return unit

    yield write
    for folder in folders:
        shutil.rmtree(folder)


def wandering(k, wheels=6):
    return 0.4 + 0.4 * np.sin(0.1 * k + np.arange(wheels))


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "steer"), [("ditch", 0.0), ("rocks", 0.0), ("turn", 0.2)])
def test_plant_moves_as_the_drive(opened, scene, steer):
    chosen = scenario(scene)
    unit, twin = opened(scene), SteppedDrive(chosen.model, 6.0, chosen.start, chosen.timing)
    if steer:
        unit["steer"] = np.full(len(unit["steer"]), steer)
    for k in range(100):
        unit["duty"] = wandering(k)
        unit.step()
        read = twin.step(Command(wandering(k), steer))
        for name in ("wheel_rate", "current", "suspension"):
            np.testing.assert_allclose(unit[name], getattr(read, name), rtol=1e-9, atol=1e-11, err_msg=name)
        for name in ("slip", "sinkage", "normal", "travel", "position", "velocity"):
            np.testing.assert_allclose(unit[name], getattr(read.truth, name), rtol=1e-9, atol=1e-11, err_msg=name)
        np.testing.assert_allclose([*unit["roll"], *unit["pitch"], *unit["yaw"]], read.attitude, atol=1e-11)
    assert np.linalg.norm(unit["position"][:2]) > 0.05
    if steer:
        assert unit["position"][1] > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("control", ["eq9", "onboard", "camera", "true"])
def test_controller_answers_as_the_package(opened, control):
    chosen = scenario("ditch", control=control)
    unit, export = opened("ditch", control), embed(chosen.controller, chosen.model)
    links = max(export.links, 1)
    names = {"duty_applied": 6, "wheel_rate": 6, "current": 6, "suspension": export.links, "roll": 1, "pitch": 1}
    names |= {"seen_speed": 1, "slip": 6, "travel": 6}
    for row in vectors(export, 100):  # all before it begins anew
        inputs, answer = np.split(np.array(row[1:]), [sum(names.values())])
        for name, values in zip(names, np.split(inputs, np.cumsum(list(names.values()))[:-1]), strict=True):
            unit[name] = values if len(values) else np.zeros(links)
        unit.step()
        outputs = np.concatenate([unit[name] for name, variable in unit.of.items() if variable.causality == "output"])
        np.testing.assert_allclose(outputs, answer, rtol=1e-9, atol=1e-10)


@pytest.mark.slow
def test_both_units_in_a_loop_drive_as_the_package(opened):
    """With a belief about unknown sand, a difference of 1e-15 changes the drive by centimetres, so that the belief of
    this test is the plant.
    """
    believes = {"control.believes": "plant"}
    plant_unit, control = opened("ditch"), opened("ditch", "onboard", **believes)
    trace = scenario("ditch", control="onboard", duration=8.0, **believes).drive(measure_error=False)
    for _ in range(160):
        control["duty_applied"] = plant_unit["duty"]
        for name in ("wheel_rate", "current", "suspension", "roll", "pitch"):
            control[name] = plant_unit[name]
        control.step()
        plant_unit["duty"] = control["duty"]
        plant_unit.step()
    assert plant_unit["position"][0] == pytest.approx(trace["body_x"][-1], abs=2e-4)
    assert plant_unit["position"][0] > 0.3


@pytest.mark.slow
def test_a_commanded_motion_drives_as_the_package(opened):
    commanded = {"control.speed": 0.03, "control.yaw_rate": 0.05}
    plant_unit, control = opened("hills", side="shear"), opened("hills", "cmd-vel")
    chosen = scenario("hills", control="cmd-vel", side="shear", duration=4.0, **commanded)
    control["speed"], control["yaw_rate"] = commanded.values()
    for _ in range(80):
        control["wheel_rate"] = plant_unit["wheel_rate"]
        control.step()
        plant_unit["duty"], plant_unit["steer"] = control["duty"], control["steer"]
        plant_unit.step()
    trace = chosen.drive(measure_error=False)
    for at, name in enumerate(("body_x", "body_y", "body_z")):
        assert plant_unit["position"][at] == pytest.approx(trace[name][-1], abs=1e-9)
    assert plant_unit["yaw"][0] == pytest.approx(trace["body_yaw"][-1], abs=1e-9)
    assert abs(trace["body_yaw"][-1]) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "control"), [("ditch", ""), ("slope", ""), ("ditch", "onboard"), ("flat", "eq9")])
def test_units_keep_to_the_standard(opened, scene, control):
    unit = opened(scene, control)
    assert validation.validate_fmu(str(unit.path)) == []
    assert unit.description.fmiVersion == "3.0"
    assert float(unit.description.coSimulation.fixedInternalStepSize) == PERIOD


@pytest.mark.slow
def test_a_state_is_restored_here_and_in_another_instance(opened):
    local = opened("ditch")
    local["duty"] = np.full(6, 0.5)
    local.step(20)
    unit, state = local.unit, local.unit.getFMUState()
    raw = unit.serializeFMUState(state)
    local.step(20)
    end = local["position"].copy()
    unit.setFMUState(state)
    assert local["position"][0] < end[0]
    local.step(20)
    np.testing.assert_array_equal(local["position"], end)
    local.unit = local.another()
    local.unit.setFMUState(local.unit.deserializeFMUState(raw))
    local.step(20)
    np.testing.assert_array_equal(local["position"], end)
    unit.setFMUState(state)
    assert local["position"][0] == end[0], "instances share nothing"
    unit.freeFMUState(state)


@pytest.mark.slow
def test_soil_may_change_during_a_drive_and_a_reset_restarts(opened):
    firm, weak = opened("incline"), opened("incline")
    for unit in (firm, weak):
        unit["duty"] = np.full(6, 0.6)
        unit.step(20)
    weak["soil.k"] = 5.0 * weak["soil.k"]
    for unit in (firm, weak):
        unit.step(60)
    assert weak["slip"].mean() > firm["slip"].mean() + 0.02
    weak.unit.reset()
    assert weak["position"][0] == 0.0
    assert weak["soil.k"] == pytest.approx(firm["soil.k"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"), [("duty", [1.5] * 6), ("duty", [np.nan] * 6), ("duty", [0.5] * 5), ("slip", [0.0] * 6),
                         ("soil.k", [-1.0])]
)  # fmt: skip
def test_values_that_are_not_allowed_are_refused(opened, name, values):
    unit = opened("flat")
    before = unit["duty"]
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        unit[name] = values
    np.testing.assert_array_equal(unit["duty"], before)


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.0, 0.02, 0.07])
def test_a_step_of_no_whole_periods_is_refused(opened, step):
    with pytest.raises(Exception, match="fmi3DoStep"):
        opened("flat").unit.doStep(0.0, step)


@pytest.mark.slow
def test_a_buried_rover_ends_its_simulation(opened):
    unit = opened("incline", **{"buried": 0.05, "terrain.angle_deg": 20.0})
    unit["duty"] = np.ones(6)
    _, terminate, early, last = unit.step(400)
    assert terminate
    assert early
    assert 0.0 < last < 20.0
    with pytest.raises(Exception, match="fmi3DoStep"):
        unit.step()


def test_command_writes_both_and_lists_their_inputs(tmp_path):
    done = CliRunner().invoke(app, ["export-fmu", "flat", "--control", "eq9", "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    assert "wheel_rate" in done.output
    for name in ("rover_plant", "rover_controller"):
        assert validation.validate_fmu(str(tmp_path / f"{name}.fmu")) == []


@pytest.mark.slow
@pytest.mark.parametrize("control", ["", "onboard", "cmd-vel"])
def test_sources_in_the_unit_are_sound(control, tmp_path):
    """The C sources in the archive build as the build description states, and the sanitizers report no error."""
    chosen = scenario("ditch", **({"control": control} if control else {}))
    fmu = unit_of(chosen.controller, chosen.model) if control else plant(chosen.model)
    with zipfile.ZipFile(write_unit(fmu, tmp_path / "unit.fmu")) as archive:
        archive.extractall(tmp_path)
    listed = re.findall(r'SourceFile name="([^"]+)"', (tmp_path / "sources" / "buildDescription.xml").read_text())
    assert set(listed) == {path.name for path in (tmp_path / "sources").glob("*.c")}
    assert all((tmp_path / "sources" / name).read_text() == text for name, text in fmu.c_files.items())
    (tmp_path / "alone").mkdir()
    inputs = [0.03] if control == "cmd-vel" else [0.5] * 6
    assert ran_sanely(fmu, tmp_path / "alone", inputs) == PERIODS
