"""What a fitted drive model leaves, and the draft of the effect that does it."""

import dataclasses
import keyword
import math
import re
from pathlib import Path

import cloudpickle
import numpy as np
import pytest

from rover_pin.contact import Contact, Soil, Wheel
from rover_pin.discrepancy.draft import score_draft as scored_draft
from rover_pin.discrepancy.signature import signatures, singles
from rover_pin.effects.effect import Body, Drive
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.noise import first_noise
from rover_pin.estimation.random_effects.learnt_noise import with_noise
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.model import nuisances, parameter, with_spread
from rover_pin.experiments.drive_log.resume import digest
from rover_pin.experiments.unlisted.actions import FORCE, GRIP, LEAN, READING, TORQUE, VOLTAGE, Act
from rover_pin.experiments.unlisted.draft import class_name, draft
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial, Wave
from rover_pin.experiments.unlisted.residual import DriveResidual, describe, draft_effect, draft_term
from rover_pin.experiments.unlisted.terms import Term
from rover_pin.inference.expansion import Expansion
from rover_pin.logs.drive_log import DriveLog, LogMetadata
from rover_pin.simulation.model.effect_files import known_effects, user_effects
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.start import Start
from tests.experiments.drafts import SameLaw, effect_in
from tests.experiments.drive_log.linear_drive import on_flat

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
ECCENTRIC = '''
from dataclasses import dataclass
from typing import ClassVar
import casadi as ca
from rover_pin.effects.effect import MotorEffect, State
from rover_pin.base.quantity import quantity

@dataclass(frozen=True)
class Eccentric(MotorEffect):
    """A wheel whose axle is off its centre."""

    a: float = quantity(0.03, "N m", "assumed", -1.0, 1.0, "a")
    states: ClassVar[tuple[State, ...]] = (State("angle", odd=True),)
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def torque(self, drive, torque, x):
        return ca.if_else(ca.fabs(drive.wheel - 3) < 0.5, self.a * ca.sin(x[0] + 0.7), 0.0)

    def rate(self, drive, torque, x):
        return (drive.omega,)
'''


def term(kind, where, argument, size, unit="N m"):
    size = np.array(size, dtype=float)
    return Term(Act(kind, where, unit, ()), argument, ("one", "two"), size, np.eye(len(size)) * 1e-6, 99.0, 20.0, 80.0)


def made(first, tmp_path):
    """The drafted effect, as an object and as its source is read back."""
    drafted = draft(first, "my draft", WHEELS)
    law = SameLaw(drafted.effect, effect_in(drafted.text, tmp_path))
    assert type(law.drafted).__name__ == "MyDraft"
    assert law.drafted.neutral == {"size": 0.0}
    return law


def argument(name, basis, unit="", per_run=False):
    return Argument(name, unit, lambda *_: np.zeros(1), basis, per_run)


def drive(delta=0.5, omega=1.0, wheel=3):
    return Drive(delta, omega, 7.2, 24.0, 3.3, wheel)


def contact(S=0.2, x=0.0):
    return Contact(S, 0.0, 0.01, 0.05, 0.0, 0.0, 0.06, x, 0.0, Wheel(), Soil())


def body(x=0.0, v_x=0.05):
    return Body(x, 0.0, 0.1, 0.0, 0.1, 0.0, v_x, *[0.0] * 5, (), (), ())


def test_a_motor_draft_gives_the_curve_at_its_wheel_alone(tmp_path):
    torque_term = term(TORQUE, "mr", argument("duty", Polynomial(0.6, 0.2, 2)), [0.01, -0.02, 0.03])
    effect, curve = made(torque_term, tmp_path), torque_term.curve
    got = [float(effect.torque(drive(delta), 0.3, ())) for delta in curve.at]
    assert np.allclose(got, curve.value, atol=1e-6)
    assert float(effect.torque(drive(0.5, wheel=2), 0.3, ())) == 0.0


def test_a_draft_of_the_wheel_angle_integrates_the_rate(tmp_path):
    torque_term = term(TORQUE, "mr", argument("wheel angle since the start", Wave(2 * math.pi), "rad"), [0.03, 0.01])
    effect, curve = made(torque_term, tmp_path), torque_term.curve
    assert [state.name for state in effect.states] == ["angle"]
    assert effect.rate(drive(omega=1.3), 0.0, (0.0,)) == (1.3,)
    assert np.allclose([float(effect.torque(drive(), 0.0, (at,))) for at in curve.at], curve.value, atol=1e-5)
    assert "wheel mr" in torque_term.description
    assert "angle" in torque_term.description
    assert "phase 18 deg" in torque_term.description


def test_a_draft_of_the_duty_adds_to_the_duty(tmp_path):
    voltage_term = term(VOLTAGE, "", argument("time", Polynomial(10.0, 10.0, 1), "s"), [0.01, 0.01], "")
    effect = made(voltage_term, tmp_path)
    assert float(effect.amend(drive(0.5), (20.0,)).delta) == pytest.approx(0.52)
    assert effect.rate(drive(), 0.0, (0.0,)) == (1.0,)


def test_force_draft_opposes_motion_where_the_curve_says(tmp_path):
    force_term = term(FORCE, "", argument("local place", Hats((0.0, 0.1, 0.2)), "m"), [0.0, 0.8, 0.0], "N")
    effect = made(force_term, tmp_path)
    assert float(effect.push(body(0.1)).f_x) == pytest.approx(-0.8, rel=0.01)
    assert float(effect.push(body(0.1, -0.05)).f_x) == pytest.approx(0.8, rel=0.01)
    assert float(effect.push(body(0.15)).f_x) == pytest.approx(-0.4, rel=0.01)
    assert float(effect.push(body(0.5)).f_x) == pytest.approx(0.0)
    assert "+0.8" in force_term.description
    assert "x = 0.05..0.15 m" in force_term.description
    lean = made(dataclasses.replace(force_term, act=force_term.act._replace(kind=LEAN)), tmp_path)
    assert float(lean.push(body(0.1, -0.05)).f_x) == pytest.approx(0.8)


def test_force_by_time_and_torque_by_slip_act_at_the_contacts(tmp_path):
    moment = term(FORCE, "", argument("moment", Hats((0.0, 1.0, 2.0)), "s", per_run=True), [0, 6.0, 0, 0, 6.0, 0], "N")
    effect = made(moment, tmp_path)
    assert float(effect.load(contact(), None, (1.0,)).f_t) == pytest.approx(-1.0, rel=0.01)
    slip = made(term(TORQUE, "", argument("slip", Polynomial(0.2, 0.2, 1)), [0.05, 0.05]), tmp_path)
    assert float(slip.load(contact(0.4), None, ()).torque) == pytest.approx(-0.1)


def test_a_grip_draft_changes_the_soil_by_its_share(tmp_path):
    grip_term = term(GRIP, "", argument("periodic place", Wave(0.4), "m"), [0.12, 0.0], "")
    changed = made(grip_term, tmp_path).amend(contact(x=0.1), ()).soil
    assert math.tan(float(changed.phi)) == pytest.approx(1.12 * math.tan(Soil().phi))
    assert "wavelength 0.40 m" in grip_term.description
    assert "12 +- 0.1 %" in grip_term.description


def test_a_reading_draft_is_a_sensor(tmp_path):
    reading_term = term(
        READING, "current_fl_A", argument("its own value", Polynomial(0.0, 1.0, 1), "A"), [0.01, 0.05], "A"
    )
    t, current = np.linspace(0, 1, 5), np.linspace(0.1, 0.3, 5)
    read = made(reading_term, tmp_path).read(t, {"current_fl_A": current})["current_fl_A"]
    assert np.allclose(read, 1.05 * current + 0.01)


def test_class_of_a_draft_is_none_of_the_names_that_its_file_imports():
    for name in ("load", "none", "true", "body effect", "state", "", "\x1b", "class", "9"):
        word = class_name(name)
        assert word.isidentifier()
        assert not keyword.iskeyword(word)
        assert word not in ("Load", "State", "Push", "ClassVar", "Effect", "BodyEffect")
    assert len(class_name(300 * "a")) < 100


def test_drafts_of_two_laws_are_two_classes_to_a_digest_and_a_draft_made_again_is_the_same():
    laws = [term(LEAN, "", argument("nothing", Polynomial(0.0, 1.0, 0)), [size], "N") for size in (0.4, 0.5, 0.4)]
    first, second, again = (digest(draft(law, "own", WHEELS).effect) for law in laws)
    assert first != second
    assert first == again


def test_a_drafted_effect_reaches_another_process():
    law = draft(term(LEAN, "", argument("nothing", Polynomial(0.0, 1.0, 0)), [0.4], "N"), "own", WHEELS).effect
    received = cloudpickle.loads(cloudpickle.dumps(law.replace(size=2.0)))
    assert float(received.push(body()).f_x) == pytest.approx(0.8)


def test_residual_drafts_the_best_term_an_effect_can_imitate():
    blind = term(TORQUE, "fl", argument("pitch", Polynomial(0.0, 0.1, 2), "rad"), [0.0, 0.1, 0.0])
    able = term(LEAN, "", argument("nothing", Polynomial(0.0, 1.0, 0)), [0.4], "N")
    remainder = DriveResidual((blind, able), (), WHEELS)
    assert re.search(r"torque.* fl .*pitch", remainder.description)
    assert "+0.4 +- 0.001 N all the time" in remainder.description
    assert "class Own(BodyEffect)" in draft_effect(remainder, "own").text
    assert DriveResidual((dataclasses.replace(able, held_out=3.0),) * 2, (), WHEELS).is_noise


def drives(hidden, count=3, duration=15.0):
    """Return the model without the hidden effects and logs of drives with them."""
    rng = np.random.default_rng(5)
    model = on_flat(Soil(k=0.005))
    true, logs = model, []
    for effect in hidden:
        true = true.having(effect)
    for run in range(count):
        steps = rng.uniform(0.5, 0.8) + rng.uniform(-0.09, 0.09, (5, 6))
        start = Start(-0.4, 0.0, 0.0) if run % 2 == 0 else Start(0.4, 0.0, math.pi)
        trace = simulate(
            true, lambda state, duty_steps=steps: duty_steps[min(int(state.t / 3), 4)], duration, start, Timing(0.01)
        )
        log = measure(trace, Sensors(), run, (), with_current=True)
        logs.append(dataclasses.replace(log, attrs={"start": dataclasses.asdict(start), "file": f"run_{run}.csv"}))
    return model, logs


def fitted(model, logs, numbers):
    """The model fitted to the logs in the noise that it leaves."""
    experiment = experiment_of([logged_run(log, model.rover) for log in logs], model)
    least = np.full(len(experiment.channels), 1e-6)
    first = first_noise(experiment.observed - experiment.predict([model])[0], least)
    base = fit(Task(experiment, first), model, numbers)
    return with_noise(base, base.residual, least)


@pytest.mark.parametrize("pull", [0.0, 4.0])
def test_a_pull_that_is_hidden_is_described_and_none_is_not(pull):
    """Two short runs one against the other: only a force against the motion slows down both."""
    model, logs = drives([TetherDrag(f_0=pull, f_1=0.0)], 2, 8.0)
    residual = describe(fitted(model, logs, (parameter(model, "soil.phi", 0.003),)))
    assert residual.is_noise is (pull == 0.0)
    if pull:
        assert (residual.best.act.kind, residual.best.argument.name) == (FORCE, "nothing")
        (curve,) = {float(value) for value in residual.best.curve.value}
        assert abs(curve - pull) < 3.0 * residual.best.curve.sd[0] + 0.25 * pull


@pytest.mark.nightly
def test_unlisted_eccentric_wheel_is_described_and_drafted(tmp_path):
    file = tmp_path / "eccentric.py"
    file.write_text(ECCENTRIC)
    (kind,) = user_effects(file)
    model, logs = drives([kind()])
    model = with_spread(model)
    free = nuisances(DriveLog(Path("test"), LogMetadata("test"), ()), model)
    free = tuple(entry for entry in free if entry.name.split(".")[0] in ("soil", "motor", "MotionResistance"))
    base = fitted(model, logs, free)
    experiment = base.task.experiment
    remainder = describe(base)
    assert not remainder.is_noise
    assert re.search(r"torque.* mr .*angle", remainder.description)
    amplitude = np.max(np.abs(remainder.best.curve.value))
    assert amplitude == pytest.approx(0.03, rel=0.25)

    drafted_file = tmp_path / "drafted.py"
    drafted_file.write_text(draft_effect(remainder, "eccentric wheel again").text)
    gains, plain = {}, Expansion(base, np.zeros((len(base.rows), 0))).posterior().log_evidence
    for effects_file in (file, drafted_file):
        listed = [
            candidate
            for candidate in candidates(base.model, experiment, base.parameters, known_effects(effects_file))
            if candidate.name.startswith("Eccentric")
        ]
        (gains[effects_file],) = singles(base, signatures(base, listed)) - plain
    assert gains[drafted_file] > 0.9 * gains[file] > 25.0
    assert {channel.name for channel in remainder.channels} == set(experiment.channels)
    tried = draft_term(base, remainder, "eccentric wheel again", lambda message: None)
    assert tried.accepted
    assert tried.log_odds > 0.9 * gains[file]
    scored = scored_draft(tried, base, 0)
    assert max(score.before / score.after for score in scored.scores) > 1.2
    assert len(scored.lines()) == 1 + len(experiment.channels)
