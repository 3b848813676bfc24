"""Whatever goes wrong in a user's test bed or effect: one sentence, with the user's file and line where it has one."""

import re
from pathlib import Path

import pytest

import rover_pin.experiments.motor_brake as shipped
from rover_pin.base.jobs.workers import Terminated
from tests.oracle import brake_generator as hidden

BED = Path(shipped.__file__).read_text(encoding="utf-8")
LAW, STEADY = "        law, values = ", "return np.nan_to_num(steady.transpose(1, 0, 2), nan=self.stand_in)"
PREDICT = 'return np.array([self._steady(model.records["motor"], model.effects) for model in models])'
SD, NOISE = "np.sqrt(np.nanmean(points[:, 4:] ** 2, axis=(0, 2)))", "    def unit(self"
ENDS = {
    "KeyError: 'x'": "        {}['x']\n",
    "ValueError: two lines": "        raise ValueError('two\\nlines')\n",
    "AssertionError": "        assert False\n",
    "RecursionError: ": "        return self._steady(motor, effects)\n",
    "SystemExit: 3": "        raise SystemExit(3)\n",
    "GeneratorExit": "        raise GeneratorExit\n",
    "BaseException: x": "        raise BaseException('x')\n",
    "MemoryError": "        bytearray(10**15)\n",
    "ModuleNotFoundError: No module named 'nothing_there'": "        import nothing_there\n",
    "LinAlgError: Singular matrix": "        np.linalg.inv(np.zeros((2, 2)))\n",
}
RETURNS = {
    "predict returns [1, 2], but a ndarray is needed": (PREDICT, "return [1, 2]"),
    "noise returns None, but a Noise is needed": (NOISE, f"    def noise(self):\n        return None\n\n{NOISE}"),
    "unit returns 3, but text is needed": ('return "rad/s" if', "return 3 if"),
    "read returns None, but a MotorBrake is needed": ("return cls(", "return None and cls("),
    "uncertain returns [1], but a tuple, each a Parameter is needed": ('"resistance"))', '"resistance")) and [1]'),
    "candidates returns <generator": ("return tuple(plain_candidate(kind())", "return (plain_candidate(kind())"),
}
SHAPES = {
    "predict returns for one model has the shape (1, 3)": (STEADY, "return np.zeros(3)"),
    "predict gives no finite number": (STEADY, "return np.full(self.observed.shape[:0] + (5, 2, 6), np.nan)"),
    "(5, 1, 6)": ('("wheel rate", "current")', '("wheel rate",)'),
    "noise().sd is not positive in some channel": (SD, "np.zeros(2)"),
    "noise().sd has the shape (1,)": (SD, "np.ones(1)"),
    "observed holds no number in some channel": ("points[:, 2:4]", "np.nan * points[:, 2:4]"),
    "channels is 'not there'": ("name, channels, ", "name, others, "),
    "folds is 3, but it must be a tuple": ("return cls(motor, folds", "return cls(motor, 3"),
    "observed holds object": ("points[:, 2:4]", "points[:, 2:4].astype(object)"),
    "'motor' has no number 'resist'": ('"resistance")', '"resist")'),
}
HEAD = """from dataclasses import dataclass
from typing import ClassVar
from rover_pin.contact import Load
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.base.quantity import quantity
@dataclass(frozen=True)
class Mine(Effect):
    a: float = quantity(0.02, "N m", "assumed", 0.0, 1.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}
    def load(self, contact, load, x):
        return Load(torque=self.a * contact.rim)
"""
LOAD, RATE = "    def load", "    def rate(self, *_):\n        return "
EFFECTS = {
    "a Contact has no 'rimm': did you mean 'rim'": ("contact.rim", "contact.rimm"),
    "line 10: Mine.load returns None, but a Load, each field of its declared type is needed": ("return Load", "Load"),
    "line 10: Mine.load returns Load(f_t=0.0, f_y=0.0, f_n=0.0, torque='x'": ("self.a * contact.rim", "'x'"),
    "line 11: the code there ends with SyntaxError: ": ("rim)", "rim"),
    "line 6: the code there ends with TypeError: ": ("a: float = quantity(", "b: float\n    a: float = quantity("),
    "line 5: the code there ends with ImportError: ": ("import quantity\n", "import nothing_there\n"),
    "line 6: Mine.neutral is ['a'], but a dict is needed": ('= {"a": 0.0}', '= ["a"]'),
    "line 6: Mine.states is ('rust',), but a tuple, each a State is needed": (LOAD, f"    states = ('rust',)\n{LOAD}"),
    "Mine.rate returns 1 rates for 0 states: give one for each state": (LOAD, f"{RATE}(1.0,)\n{LOAD}"),
    "line 10: Mine.rate returns 1.0, but a tuple, each a number or": (LOAD, f"{RATE}1.0\n{LOAD}"),
    "The formulas of the effects (contact_law) hold nan": ("self.a * ", "float('nan') * "),
    "The formulas of the effects (contact_law) hold q": ("self.a * ", "__import__('casadi').SX.sym('q') * "),
    "it has a.": ('{"a": 0.0}', '{"b": 0.0}'),
    "Mine.a = -2 N m is not allowed": ('{"a": 0.0}', '{"a": -2.0}'),
    "neutral: ClassVar": ('    neutral: ClassVar[dict[str, float]] = {"a": 0.0}\n', ""),
    "it has none. Is @dataclass(frozen=True) above the class?": ("@dataclass(frozen=True)\n", ""),
}  # fmt: skip


def refused(run, *words):
    code, out, err = run(*words)
    *before, last_line = err.splitlines()
    assert (code, out) == (2, ""), (out, err)
    assert set(before) <= {"calibrating the base model"}
    return last_line


@pytest.fixture
def bed(run):
    def refusal(old, new):
        hidden.write(Path("brake"), 0)
        assert old in BED
        Path("mine.py").write_text(BED.replace(old, new, 1))
        return refused(run, "close-loop", "brake", "--experiment", "mine.py")

    return refusal


@pytest.mark.parametrize("ending", ENDS)
def test_what_a_bed_raises_has_its_file_and_line(ending, bed):
    line = BED[: BED.index(LAW)].count("\n") + 1
    assert re.search(rf"mine\.py, line {line}: .*{ending}", bed(LAW, ENDS[ending] + LAW))


@pytest.mark.parametrize("wrong", RETURNS)
def test_what_a_bed_returns_is_held_against_its_base(wrong, bed):
    assert re.search(rf"mine.py, line \d+: MotorBrake.{re.escape(wrong)}", bed(*RETURNS[wrong]))


@pytest.mark.parametrize("wrong", SHAPES)
def test_arrays_of_a_bed_that_do_not_fit_are_refused(wrong, bed):
    assert wrong in bed(*SHAPES[wrong])


@pytest.mark.parametrize("stop", [KeyboardInterrupt, Terminated])
def test_a_stop_inside_a_bed_stays_a_stop(stop, run):
    hidden.write(Path("brake"), 0)
    text = "from rover_pin.base.jobs.workers import Terminated\n" + BED.replace(
        LAW, f"        raise {stop.__name__}\n{LAW}"
    )
    Path("mine.py").write_text(text)
    code, _, err = run("close-loop", "brake", "--experiment", "mine.py")
    assert code == (130 if stop is KeyboardInterrupt else 143)
    assert "stopped" in err


@pytest.mark.parametrize("wrong", EFFECTS)
def test_what_is_wrong_in_an_effect_has_its_file_and_line(wrong, run):
    old, new = EFFECTS[wrong]
    assert old in HEAD
    Path("mine.py").write_text(HEAD.replace(old, new, 1))
    Path("data").mkdir()
    error_line = refused(run, "close-loop", "data", "--effects", "mine.py")
    assert wrong in error_line
    assert "mine.py" in error_line
