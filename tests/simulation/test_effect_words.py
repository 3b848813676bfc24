"""Effects as words of a command line: the effect of each word, words for every effect, and the refusal of
wrong words."""

import json
import math

import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import quantities
from rover_pin.base.trust import Trust
from rover_pin.cli.app import app
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.effect_files import package_effects, reading_traction
from rover_pin.simulation.model.effect_words import effect_of, having, word_of

MODEL = scenario("flat", form="gross").model


def test_effect_of_one_wheel_accepts_the_wheel_name_or_number():
    model = having(MODEL, "WeakMotor.wheel=2,g=0.3 WeakMotor.wheel=fr,g=0.5 WeakMotor.wheel=2,g=0.4")
    fr = [mount.name for mount in MODEL.rover.wheels].index("fr")
    assert set(model.motor_effects) == {WeakMotor(wheel=2, g=0.4), WeakMotor(wheel=fr, g=0.5)}
    name = MODEL.rover.wheels[3].name
    assert effect_of("TachoScale.wheel=3", MODEL) == effect_of(f"TachoScale.wheel={name}", MODEL)
    assert effect_of("TachoScale.wheel=3", MODEL) == TachoScale(wheel=name)


@pytest.mark.parametrize("kind", package_effects(), ids=lambda kind: kind.__name__)
def test_every_effect_can_be_written_as_a_word_and_read_back(kind):
    effect = reading_traction(kind(), MODEL.all_effects)
    halfway = {
        name: 0.5 * (float(getattr(effect, name)) + (quantity.high if math.isfinite(quantity.high) else 1.0))
        for name, quantity in quantities(effect).items()
    }
    changed = effect.replace(**halfway)
    assert effect_of(word_of(changed), MODEL) == changed


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("DigingMemory", r"'DigingMemory'.*'DiggingMemory'\?"),
        ("DiggingMemory.cd=0.1", r"DiggingMemory.*'cd':.*'c_d'\?"),
        ("DiggingMemory.c_d", "'c_d'.*EFFECT.*EFFECT.name=value"),
        ("DiggingMemory.", "EFFECT.*EFFECT.name=value"),
        ("DiggingMemory.c_d=0.1,,length=1", "'' sets no field"),
        ("DiggingMemory.c_d=much", "c_d = 'much'"),
        ("DiggingMemory.c_d=7", r"^effect DiggingMemory: DiggingMemory.c_d = 7.*\[0"),
        ("DiggingMemory.c_d_deg=7", "'c_d_deg'"),
        ("DiggingMemory.wheel=2", "DiggingMemory.*'wheel'"),
        ("WeakMotor.wheel=fx", "WeakMotor.wheel=fx:.*'fx'"),
        ("WeakMotor.wheel=9", "rover.*9"),
        ("SoilTraction.form=nett", "'nett':.*'net'"),
    ],
)
def test_a_word_that_cannot_be_read_is_reported(word, says):
    with pytest.raises(ParameterError, match=says):
        having(MODEL, word)


def test_a_scenario_takes_effects_and_words_and_reports_them():
    drive = scenario("incline", duration=1.0, add=[DiggingMemory(c_d=0.1), "PostPeak.fraction=0.2"])
    assert drive.model.effect(PostPeak).fraction == 0.2
    trace = drive.drive()
    again = scenario("incline", **trace.attrs["settings"])
    assert again.model.effects == drive.model.effects
    assert {"DiggingMemory", "PostPeak"} <= {name.split("(")[0] for name in trace.attrs["effects"]}


OWN = """
from dataclasses import dataclass
from typing import ClassVar
from rover_pin.base.quantity import quantity
from rover_pin.effects.effect import Effect
from rover_pin.contact import Load

@dataclass(frozen=True)
class Drag(Effect):
    share: float = quantity(0.05, "", "assumed", 0.0, 1.0)
    neutral: ClassVar[dict] = {"share": 0.0}

    def load(self, contact, load, x):
        return Load(f_t=-self.share * load.f_n)
"""


def test_a_word_is_also_an_effect_of_a_file_that_is_trusted(tmp_path):
    (tmp_path / "drag.py").write_text(OWN)
    (tmp_path / "control.py").write_text("def controller(model):\n    return lambda reading: 0.5\n")
    trust = Trust.of([tmp_path / "control.py", tmp_path / "drag.py"])
    model = having(MODEL, ["Drag.share=0.1", "PostPeak", "Drag.share=0.2"], trust)
    (all_effect,) = [effect for effect in model.all_effects if type(effect).__name__ == "Drag"]
    assert all_effect.share == 0.2
    assert model.effect(PostPeak) == PostPeak()
    with pytest.raises(ParameterError, match="needs --effects FILE"):
        having(MODEL, "Drag")


def test_a_drive_adds_a_users_effect(tmp_path):
    (tmp_path / "drag.py").write_text(OWN)
    ways = []
    for more in ([], ["--effects", str(tmp_path / "drag.py"), "--add", "Drag.share=0.1"]):
        words = ["drive", "flat", "--set", "duration=2", "--json", "--out", str(tmp_path / "out"), *more]
        ways.append(json.loads(CliRunner().invoke(app, words).stdout)["distance_m"])
    assert ways[1] < ways[0] - 0.003
