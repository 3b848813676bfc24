"""Model files: every effect is written and read back, and each fault in a file has its error."""

import re

import numpy as np
import pytest

from rover_pin import Soil, Wheel, load_rover, scenario, simulate
from rover_pin.base.errors import DataError, ParameterError, UrdfError
from rover_pin.base.quantity import is_symbolic, quantities
from rover_pin.base.trust import Trust
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel
from rover_pin.experiments.wheel_rig.model import write_model as write_rig_model
from rover_pin.simulation.model.effect_files import package_effects, user_effects
from rover_pin.simulation.model.toml_file import read_model, write_model
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction
from rover_pin.terrain import shapes

FLAT = shapes.flat()
BASE = scenario("flat", soil="table-1").model


def alike(first, second):
    """Return whether two models are equal, except for their rover objects and terrains."""
    stored = (
        "soils",
        "motor",
        "slip",
        "effects",
        "motor_effects",
        "gravity",
        "body_effects",
        "sensor_effects",
        "buried",
    )
    assert {name: getattr(first, name) for name in stored} == {name: getattr(second, name) for name in stored}
    assert (first.rover.name, first.rover.urdf) == (second.rover.name, second.rover.urdf)


def drawn(kind, rng):
    """Return the effect with random quantities within their bounds, and with choices other than the defaults."""
    effect = kind()
    ends = {name: (max(quantity.low, -9.0), min(quantity.high, 9.0)) for name, quantity in quantities(effect).items()}
    changes = {name: float(rng.uniform(*end)) for name, end in ends.items()}
    other_fields = {"form": GrossTraction(), "angles": SinkageAngles(), "channel": "body_roll"}
    changes |= {name: choice for name, choice in other_fields.items() if hasattr(effect, name)}
    if hasattr(effect, "wheel"):
        changes["wheel"] = 3 if isinstance(effect.wheel, int) else "mr"
    return effect.replace(**changes)


@pytest.mark.parametrize("kind", package_effects(), ids=lambda kind: kind.__name__)
def test_every_effect_comes_back_as_it_was(tmp_path, kind):
    rng = np.random.default_rng(7)
    for effect in (kind(), drawn(kind, rng), drawn(kind, rng)):
        model = BASE.having(effect)
        alike(read_model(write_model(model, tmp_path / "model.toml"), FLAT), model)


def test_a_whole_model_comes_back_in_order(tmp_path):
    model = scenario("incline", soil="table-1", gravity="moon", **{"soil.k": 0.0123, "motor.gear": 250.0}).model
    for wheel in (4, 1):
        model = model.having(WeakMotor(g=0.1 * wheel, wheel=wheel))
    model = model.having(TachoScale(wheel="fl")).having(TachoScale(wheel="rr", e=0.1)).having(AlgebraicSlip())
    path = write_model(model, tmp_path / "model.toml", note='from "slope"')
    again = read_model(path, model.terrain)
    alike(again, model)
    assert again.terrain is model.terrain
    assert 'note = "from \\"slope\\""' in path.read_text()
    alike(read_model(write_model(again, tmp_path / "again.toml"), FLAT), model)
    assert path.read_text().replace('from \\"slope\\"', "") == (tmp_path / "again.toml").read_text()


OWN_EFFECT = """
from dataclasses import dataclass
from rover_pin.effects.effect import MotorEffect
from rover_pin.base.quantity import quantity

@dataclass(frozen=True)
class Squeak(MotorEffect):
    loud: float = quantity(1.0, "", "assumed", 0.0, 9.0)
    neutral = {"loud": 0.0}
"""


def test_a_users_effect_keeps_its_file(tmp_path):
    (tmp_path / "squeak.py").write_text(OWN_EFFECT)
    (kind,) = user_effects(tmp_path / "squeak.py")
    trust = Trust.of(tmp_path / "squeak.py")
    path = write_model(BASE.having(kind(loud=2.0)), tmp_path / "model.toml")
    assert str(tmp_path / "squeak.py") in path.read_text()
    path.write_text(path.read_text().replace(str(tmp_path / "squeak.py"), "squeak.py"))
    (motor_effect,) = read_model(path, FLAT, trust).motor_effects
    assert (type(motor_effect).__name__, motor_effect.loud) == ("Squeak", 2.0)
    for content, says in (
        ("import nonsense_that_is_not", "squeak.py, line 1: the code there ends with ModuleNotFoundError"),
        ("", "defines no effect"),
    ):
        (tmp_path / "squeak.py").write_text(content)
        with pytest.raises(DataError, match=says):
            read_model(path, FLAT, trust)
    (tmp_path / "squeak.py").unlink()
    with pytest.raises(DataError, match=r"squeak\.py:.*\.py file"):
        read_model(path, FLAT, trust)


def test_an_effect_without_a_file_cannot_be_written(tmp_path):
    """Such an effect is a class that was typed at a prompt."""
    namespace = {"__name__": "prompt"}
    exec(compile(OWN_EFFECT, "<stdin>", "exec"), namespace)
    with pytest.raises(DataError, match=r"effect.*:.*\.py"):
        write_model(BASE.having(namespace["Squeak"]()), tmp_path / "model.toml")


def test_a_users_rover_needs_its_path(tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    from rover_pin.rover.description.layout import rover_folder

    for name in ("nexus6.toml", "nexus6.urdf"):
        text = (rover_folder() / name).read_text().replace('name = "nexus6"', 'name = "mine"')
        (folder / name).write_text(text)
    model = BASE.replace(rover=load_rover(folder / "nexus6.toml"))
    assert model.rover.name == "mine"
    with pytest.raises(DataError, match=r"'mine'.*package"):
        write_model(model, tmp_path / "model.toml")
    alike(read_model(write_model(model, tmp_path / "model.toml", rover="own/nexus6.toml"), FLAT), model)


def test_an_expression_cannot_be_written(tmp_path):
    import casadi as ca

    model = BASE.replace(soils=(Soil(k=ca.SX.sym("k")),) * 2)
    assert is_symbolic(model.soils[0].k)
    with pytest.raises(ParameterError, match=r"Soil\.k.*expression"):
        write_model(model, tmp_path / "model.toml")


@pytest.mark.parametrize(
    ("message", "instead", "error", "says"),
    [
        ("drive-model", "rig-model", DataError, "kind = 'rig-model'"),
        ('note = ""', 'notes = ""', DataError, "you mean 'note'?"),
        ('"WeakMotor"', '"WeakMoter"', DataError, "effect 'WeakMoter': did you"),
        ('"SoilTraction"', '"Pivot"', DataError, "effect 'Pivot'"),
        ("\ng = {", "\ngg = {", ParameterError, "WeakMotor: WeakMotor"),
        ("g = {value = 0.2}", "g = 1.5", ParameterError, "WeakMotor.g = 1.5"),
        ("wheel = 0", "wheel = 6", ParameterError, "wheel = 6, but rover 'nexus6'"),
        ("wheel = 0", 'wheel = "fl"', DataError, "wheel = 'fl'"),
        ('wheel = ""', 'wheel = "lf"', ParameterError, "wheel = 'lf'"),
        ('"torque"', '"tork"', DataError, "traction form 'tork': known"),
        ('"FixedAngles"', '"Fixed"', DataError, "angles 'Fixed': did you"),
        ("[gravity]\nvalue = 9.81", "[gravity]\nvalue = -1.0", DataError, "number in (0, 100) m/s^2"),
        ('rover = "nexus6"', 'rover = "nexus"', UrdfError, "you mean 'nexus6'?"),
        ('rover = "nexus6"', 'rover = "nexus6"\nmotor = 3', DataError, "is not TOML"),
        ('unit = "rad"', 'unit = "m"', ParameterError, "'phi': unit 'm' does"),
    ],
)
def test_mistakes_in_a_file(tmp_path, message, instead, error, says):
    path = write_model(BASE.having(WeakMotor()).having(TachoScale()), tmp_path / "model.toml")
    assert message in path.read_text()
    path.write_text(path.read_text().replace(message, instead, 1))
    with pytest.raises(error, match=re.escape(says)):
        read_model(path, FLAT)


def test_a_key_of_another_form_and_a_missing_terrain(tmp_path):
    path = tmp_path / "model.toml"
    for text, says in (
        ("motor = 3", "motor = 3 must be a table"),
        ("soil = 3", "soil = 3 must be a list of tables"),
        ('slip = { name = "WeakMotor" }', "[slip]: WeakMotor is no law of slip: give AlgebraicSlip or RelaxedSlip"),
    ):
        path.write_text(f'kind = "drive-model"\n{text}\n')
        with pytest.raises(DataError, match=re.escape(says)):
            read_model(path, FLAT)
    with pytest.raises(DataError, match=r"\[terrain\]:.*terrain"):
        read_model(write_model(BASE, path))


def test_a_scenario_drives_a_models_file(tmp_path):
    weak = scenario("flat", soil="table-1", **{"soil.k": 0.02}).model.having(WeakMotor(wheel=1))
    file = str(write_model(weak, tmp_path / "model.toml"))
    ready = scenario("bump", model=file, gravity="moon", **{"effect.WeakMotor.g": 0.1})
    assert ready.model.motor_effects == (WeakMotor(g=0.1, wheel=1),)
    assert (ready.model.soils[0].k, ready.model.gravity) == (0.02, 1.62)
    assert ready.model.terrain == shapes.bump()
    assert not ready.symmetric
    with pytest.raises(ParameterError, match=r"model.*change"):
        scenario("bump", model=file, soil="table-1")


RIG = RigModel(Wheel(0.1, 0.1), Soil(k=0.004, n=1.4), (*PAPER, SlipSinkage(n_1=0.8)))


def test_a_rover_drives_on_a_wheels_model(tmp_path):
    file = str(write_rig_model(RIG, tmp_path / "rig.toml"))
    for rover in ("nexus6", "cart"):
        ready = scenario("flat", model=file, rover=rover, **{"effect.SlipSinkage.n_1": 0.5, "soil.c": 10.0})
        model = ready.model
        assert model.soils[0] == RIG.soil.replace(c=10.0)
        assert model.rover.wheel == load_rover(rover).wheel != RIG.wheel
        assert model.effect(SlipSinkage) == SlipSinkage(n_1=0.5)
        assert model.effect(SoilTraction) == PAPER[0]
        assert {type(effect) for effect in model.effects} == {SoilTraction, NormalDamping, SideShear, SlipSinkage}
        assert simulate(model, ready.controller, 0.2).attrs["traction_form"] == "net"
    with pytest.raises(ParameterError, match=r"model.*change"):
        scenario("flat", model=file, soil="table-1")
    bare = write_rig_model(RigModel(RIG.wheel, RIG.soil, ()), tmp_path / "bare.toml")
    with pytest.raises(DataError, match=r"bare.toml:.*\[\[effect\]\] SoilTraction"):
        scenario("flat", model=str(bare))


def test_burial_cut_is_kept_and_refused_if_not_a_radius_share(tmp_path):
    path = write_model(BASE.replace(buried=0.9), tmp_path / "model.toml")
    alike(read_model(path, FLAT), BASE.replace(buried=0.9))
    path.write_text(path.read_text().replace("buried = 0.9", 'buried = "deep"'))
    with pytest.raises(DataError, match="buried = 'deep'"):
        read_model(path, FLAT)
