"""An effect of one's own to start from: it runs as it stands, and passes the test of its contract."""

import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect
from rover_pin.loop.own_code import refuse_unfit_effects
from rover_pin.simulation.model.effect_files import user_effects

KINDS = {"contact": Effect, "motor": MotorEffect, "body": BodyEffect}


@pytest.mark.parametrize("acts", KINDS)
def test_it_is_an_effect_that_the_loop_takes(run, acts):
    code, out, _ = run("new-effect", "StickySoil", "--acts", acts)
    assert code == 0
    assert "pytest test_sticky_soil.py" in out
    (kind,) = user_effects("sticky_soil.py")
    assert issubclass(kind, KINDS[acts])
    assert kind.__name__ == "StickySoil"
    refuse_unfit_effects("sticky_soil.py")


@pytest.mark.slow
@pytest.mark.parametrize("acts", KINDS)
def test_its_own_test_passes(run, acts):
    run("new-effect", "MyOwn", "--acts", acts)
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_my_own.py"]
    assert subprocess.run(words, check=False).returncode == 0


@pytest.mark.slow
def test_the_contract_notices_an_effect_that_does_nothing(run):
    run("new-effect", "MyOwn")
    file = Path("my_own.py")
    file.write_text(file.read_text().replace("torque=self.a *", "torque=0.0 * self.a *"))
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_my_own.py"]
    completed = subprocess.run(words, check=False, capture_output=True, text=True)
    assert completed.returncode == 1
    assert "test_it_changes_a_drive" in completed.stdout


def test_names_and_files_are_refused_in_one_sentence(run):
    assert "'sticky'" in run("new-effect", "sticky")[2]
    run("new-effect", "StickySoil")
    assert "sticky_soil.py" in run("new-effect", "StickySoil")[2]
