"""Studies from files, gains to files and back, and every refusal."""

from pathlib import Path

import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.slip_control import Gains, load_gains, save_gains
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.tuning.drives import build
from rover_pin.tuning.study import DriveCase, TuningStudy, value_at
from rover_pin.tuning.study_file import read_tuning
from studies.shared.drawn_drives import random_drives

EXAMPLE = Path(__file__).parents[2] / "studies" / "tune_ditch.toml"
ONE = (DriveCase("flat", "flat"),)


def written(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text)
    return path


def test_the_example_is_read():
    study = read_tuning(EXAMPLE)
    assert len(study.training) == 7
    assert len(study.held_out) == 8
    assert study.free["S_d"] == (0.05, 0.9)
    assert dict(study.training[0].settings)["soil.k"] == 0.0073
    assert dict(study.training[0].settings)["add"] == "DiggingMemory.c_d=0.08"
    assert study.training[1].post_peak == 0.3


def test_gains_go_to_a_file_and_back(tmp_path):
    gains = Gains(S_d=0.2, k_p=1 / 3)
    assert load_gains(save_gains(gains, tmp_path / "out" / "gains.toml", "two\nlines")) == gains


def test_free_gains_run_between_their_bounds_on_their_scale():
    study = TuningStudy("s", ONE, free={"k_p": (0.01, 1.0), "S_d": (0.0, 0.5)})
    assert study.law([0.5, 0.5]).gains.k_p == pytest.approx(0.1)
    assert study.law([0.5, 0.5]).gains.S_d == pytest.approx(0.25)
    assert value_at("k_i", (0.3, 0.7), 1.0) == 0.7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "s"', "no training drives"),
        ("seeds = 1", r"'seeds':.*'seed'\?"),
        ("[effort]\npopulaton = 9\n[[training]]\nscenario = 'flat'", r"'populaton':.*'population'\?"),
        ("[effort]\npopulation = 2\n[[training]]\nscenario = 'flat'", "population = 2"),
        ("[free]\nkp = [1, 2]\n[[training]]\nscenario = 'flat'", r"'kp':.*'k_p'\?"),
        ("[free]\nk_p = [2, 1]\n[[training]]\nscenario = 'flat'", "low = 2.*high = 1"),
        ("[free]\nk_p = [0, 1]\n[[training]]\nscenario = 'flat'", "logarithmic scale"),
        ("[free]\nS_d = [0, 3]\n[[training]]\nscenario = 'flat'", r"lie.*\[-1, 1\]"),
        ("[free]\nS_d = 0.3\n[[training]]\nscenario = 'flat'", r"two numbers, \[low, high\]"),
        ("[free]\n[[training]]\nscenario = 'flat'", "free gains"),
        ("estimate = 'eq8'\n[[training]]\nscenario = 'flat'", r"estimate = 'eq8' .*'eq9'\?"),
        ("[cost]\nspeed = 1\n[[training]]\nscenario = 'flat'", "field 'speed'"),
        ("[before]\nk_q = 1\n[[training]]\nscenario = 'flat'", r"no field 'k_q'"),
        ("[[training]]\nsoil.k = 0.01", "training 1"),
        ("training = 3", "list.*drives"),
        ("[[training]]\nname='a'\nscenario='flat'\n[[held_out]]\nname='a'\nscenario='flat'", "drives.*'a'"),
    ],
)
def test_refusals_are_one_clear_sentence(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(ParameterError, match=message) as caught:
        read_tuning(path)
    assert str(caught.value).startswith(str(path))


def test_random_drives_depend_on_the_seed_only():
    drives = random_drives(3, 4, 2, 30.0)
    assert drives == random_drives(3, 4, 2, 30.0)
    assert drives != random_drives(4, 4, 2, 30.0)
    assert [drive.scenario for drive in drives] == ["ditch"] * 4 + ["incline"] * 2
    assert len({drive.name for drive in drives}) == 6
    assert any(drive.post_peak for drive in drives)
    assert not all(drive.post_peak for drive in drives)


def test_random_drives_that_dig_are_else_the_same():
    """A share of them gets a c_d of its own and can be built; none and all are none and all."""
    plain = random_drives(3, 4, 4, 30.0)
    some = random_drives(3, 4, 4, 30.0, digging=0.5)
    digging = [dict(drive.settings).pop("add", None) for drive in some]
    assert 0 < sum(drive is not None for drive in digging) < 8
    for plain_drive, digging_drive in zip(plain, some, strict=True):
        assert [drive for drive in digging_drive.settings if drive[0] != "add"] == list(plain_drive.settings)
    assert random_drives(3, 4, 4, 30.0, digging=0.0) == plain
    everywhere = random_drives(3, 4, 4, 30.0, digging=1.0)
    assert all(0.02 <= build(drive).model.effect(DiggingMemory).c_d <= 0.1 for drive in everywhere)
    with pytest.raises(ParameterError, match=r"digging = 1.5"):
        random_drives(3, 1, 1, 30.0, digging=1.5)


def test_both_shipped_studies_can_be_built():
    for name in ("tune_slopes.toml", "tune_ditch.toml"):
        study = read_tuning(EXAMPLE.with_name(name))
        cases = (*study.training, *study.held_out)
        assert sum(any(isinstance(e, DiggingMemory) for e in build(case).model.effects) for case in cases) >= 9
