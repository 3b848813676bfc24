"""A user's effect files: every mistake is one sentence before any fit."""

import pytest

from rover_pin.base.errors import DataError
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.own_effects import refuse_unfit_effects
from rover_pin.measurements.rig_file import RIG_FILE

GOOD = '''
from dataclasses import dataclass
from typing import ClassVar
import casadi as ca
from rover_pin.contact import Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.base.quantity import quantity

@dataclass(frozen=True)
class StickySoil(Effect):
    """torque += a tanh(rim / v_0)."""
    a: Scalar = quantity(0.02, "N m", "assumed", 0.0, 1.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def load(self, contact, load, x):
        return Load(torque=self.a * ca.tanh(contact.rim / 0.005))
'''


@pytest.fixture
def effect(tmp_path):
    def write(old="", new=""):
        file = tmp_path / "sticky.py"
        file.write_text(GOOD.replace(old, new) if old else GOOD)
        return file

    return write


def test_a_good_effect_passes(effect):
    refuse_unfit_effects(effect())


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("(contact.rim", "contact.rim", "sticky.py, line 16: the code there ends with SyntaxError: "),
        (
            '    neutral: ClassVar[dict[str, float]] = {"a": 0.0}\n',
            "",
            "StickySoil does not say at which values it vanishes",
        ),
        ('{"a": 0.0}', '{"b": 0.0}', "StickySoil has a neutral value for 'b', which is no quantity of it: it has a."),
        ('{"a": 0.0}', '{"a": -2.0}', "StickySoil.a = -2 N m is not allowed"),
        ("@dataclass(frozen=True)\n", "", "it has none. Is @dataclass(frozen=True) above the class?"),
        ("contact.rim /", "contact.rimm /", "sticky.py, line 16: the code there ends with AttributeError: "),
        ("ca.tanh", "cas.tanh", "sticky.py, line 16: the code there ends with NameError: name 'cas' is not defined"),
        ("torque=self.a", "moment=self.a", "sticky.py, line 16: the code there ends with TypeError: "),
    ],
)
def test_what_is_wrong_with_an_effect_is_told(effect, old, new, says):
    with pytest.raises(Exception, match=r"\w") as refused:
        refuse_unfit_effects(effect(old, new))
    assert type(refused.value).__name__ in ("DataError", "ParameterError")
    assert says in str(refused.value)


def test_the_loop_refuses_effects_and_results_before_any_work(effect, tmp_path):
    (tmp_path / RIG_FILE).write_text("")
    with pytest.raises(DataError, match="the code there ends with SyntaxError"):
        close_the_loop(tmp_path, effects=effect("(contact.rim", "contact.rim"))
    with pytest.raises(DataError, match=r"rig.toml: a file stands where the results go; give a folder\."):
        close_the_loop(tmp_path, out=tmp_path / RIG_FILE)
