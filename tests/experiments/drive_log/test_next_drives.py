"""The drives that could be made next: what they offer, which is proposed, and that it tells who is right."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Soil, Trace
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.noise import first_noise, noise_of
from rover_pin.experiments.drive_log import next_drives as next_drives_file
from rover_pin.experiments.drive_log.candidates import candidate_of
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.model import parameter
from rover_pin.experiments.drive_log.next_drives import _choice, _offer_of_run, next_drives
from rover_pin.inference.next_measurement import expectation, next_measurement, with_uncertain_numbers
from rover_pin.simulation.replay import PERIOD, Replay, ReplayCommands, replay
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.start import Start
from rover_pin.terrain.shapes import flat
from tests.experiments.drive_log.linear_drive import on_flat

WEAK, TACHO = "WeakMotor[2]", "TachoScale[ml]"


@pytest.fixture(scope="module")
def model():
    return on_flat(Soil(k=0.005))


def driven(model, commands, seed):
    """Return the log of a free drive, with the noise of the default sensors, without currents."""
    return logged_run(measured_log(model, commands, seed), model.rover)


def measured_log(model, commands, seed):
    drive = replay(model, commands)
    wheels = [wheel.name for wheel in model.rover.wheels]
    duty = {f"duty_{name}": commands.duty[:, at] for at, name in enumerate(wheels)}
    trace = Trace({**drive.channels, **duty}, attrs={"start": dataclasses.asdict(commands.start)})
    return measure(trace, Sensors(), seed, model.sensor_effects, with_current=False)


def forward(model, seed, seconds=12.0):
    """Return the commands of a drive towards +x at duties that change."""
    t = PERIOD * np.arange(round(seconds / PERIOD))
    levels = np.random.default_rng(seed).uniform(0.45, 0.85, 4)[np.arange(len(t)) * 4 // len(t)]
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in model.rover.wheels)))
    return ReplayCommands(t, np.repeat(levels[:, None], 6, axis=1), steer, np.full((len(t), 3), np.nan), Start())


def logged(truth, base):
    """Return two runs of a hidden truth as the task of fitting them, their noise known."""
    experiment = experiment_of([driven(truth, forward(truth, seed), seed) for seed in (1, 2)], base)
    left = experiment.observed - experiment.predict([truth])[0]
    least = np.full(len(experiment.channels), 1e-6)
    return Task(experiment, noise_of(left, first_noise(left, least).good, least))


def fitted(task, model, effect=None, name=None, also=()):
    """Return a fit of a few uncertain numbers and of one size of an effect."""
    model_fitted = model if effect is None else model.having(effect)
    free = [
        parameter(model_fitted, "soil.phi", math.radians(2.0)),
        parameter(model_fitted, "motor.gear", 0.04, log=True),
    ]
    free += [parameter(model_fitted, "motor.resistance", 0.04, log=True), *also]
    return fit(task, model_fitted, [*free, *([candidate_of(effect).size(name)] if name else [])])


@pytest.fixture(scope="module")
def tilted(model):
    """Return a tilted table driven in one direction only, fitted as that and as a tether."""
    task = logged(model.having(GravityTilt(rise_x=0.015)), model)
    return (
        fitted(task, model, GravityTilt(rise_x=0.01), "GravityTilt.rise_x"),
        fitted(task, model, TetherDrag(f_0=0.5, f_1=0.0), "TetherDrag.f_0"),
    )


def told(fits, offers, say=lambda message: None):
    """Return what is proposed to tell equally probable fits apart."""
    return next_measurement([(1.0 / len(fits), candidate_set) for candidate_set in sets_of(fits)], offers, say)


def sets_of(fits, names=()):
    """Return fits as sets of causes, by the kind of their last effect unless they are named."""
    names = names or [type(drive_fit.model.all_effects[-1]).__name__ for drive_fit in fits]
    return [
        SimpleNamespace(
            names=(name,), fit=drive_fit, experiment=drive_fit.task.experiment,
            posterior=SimpleNamespace(covariance=drive_fit.covariance),
        )
        for name, drive_fit in zip(names, fits, strict=True)
    ]  # fmt: skip


def run_called(fits, words):
    return next(run for run in _choice(sets_of(fits)) if words in run.label)


def test_a_tilt_is_told_from_a_tether_by_the_other_heading(tilted):
    unchanged, back = (_offer_of_run(run_called(tilted, f"flat towards {way}x"), tilted[0]) for way in "+-")
    proposal, poor = told(tilted, [back]), told(tilted, [unchanged])
    assert proposal.nats > 0.9 * math.log(2.0)
    assert poor is None or poor.nats < 0.2 * proposal.nats
    assert proposal.what.startswith("20 s on the flat towards -x at a constant duty of 0.6")


@pytest.mark.parametrize("truth", [0, 1])
def test_the_proposed_drive_tells_who_is_right(tilted, truth):
    """It is made, with noise, by either model: what that one expected of it is the more probable."""
    offer = _offer_of_run(run_called(tilted, "flat towards -x"), tilted[0])
    (ahead,) = offer.experiment.runs
    log = logged_run(
        measured_log(tilted[truth].model.replace(terrain=flat()), ahead.commands, seed=20 + truth),
        tilted[0].model.rover,
    )
    names = [name for name in offer.experiment.channels if name not in offer.unmeasured]
    logs = []
    for drive_fit in tilted:
        namespace = SimpleNamespace(
            fit=drive_fit,
            experiment=drive_fit.task.experiment,
            posterior=SimpleNamespace(covariance=drive_fit.covariance),
        )
        expected = with_uncertain_numbers(offer, namespace, expectation(offer, namespace, namespace))
        table = np.full(offer.noise.good.shape, np.nan)
        table[0, [offer.experiment.channels.index(name) for name in names]] = log.observed[
            [log.channels.index(name) for name in names]
        ]
        rows = offer.noise.white(np.nan_to_num(table))
        used = np.isfinite(table[offer.noise.good])
        mean, covariance = expected.at(used)
        left = rows[used] - mean
        logs.append(-0.5 * left @ np.linalg.solve(covariance, left) - 0.5 * np.linalg.slogdet(covariance)[1])
    assert logs[truth] > logs[1 - truth] + 3.0


def test_a_run_that_cannot_be_driven_is_not_offered(tilted, monkeypatch):
    def stopped(*value, **named):
        return Replay({}, "the rover tips")

    monkeypatch.setattr(next_drives_file, "replay", stopped)
    assert _offer_of_run(run_called(tilted, "flat towards -x"), tilted[0]) is None


def test_what_holds_at_every_duty_needs_currents(model):
    task = logged(model.having(GearFriction(tau_c=0.06)), model)
    fits = (
        fitted(task, model, GearFriction(), "GearFriction.tau_c"),
        fitted(task, model, DeadBand(), "DeadBand.delta_0"),
    )
    assert fits[0].chi2 == pytest.approx(fits[1].chi2, abs=4.0)
    proposal = told(fits, [_offer_of_run(run_called(fits, "flat, the duty stepping"), fits[0])])
    assert proposal.what.endswith(", with current_fl_A to current_rr_A too")
    assert proposal.channel.startswith("current_")


def test_an_effect_at_a_place_is_sought_on_the_logged_ground(tilted):
    patched = dataclasses.replace(tilted[1], model=tilted[1].model.having(HardPatch(x_from=0.3)))
    runs = _choice(sets_of((tilted[0], patched)))
    assert runs
    assert all(run.terrain is None for run in runs)


@pytest.mark.slow
def test_all_runs_are_weighed_for_a_tilt_and_a_tether(tilted):
    messages = []
    proposal = told(tilted, next_drives(sets_of(tilted)), messages.append)
    assert "-x" in proposal.what or "back" in proposal.what
    assert proposal.nats > 0.9 * math.log(2.0)
    assert len(messages) >= 16


@pytest.mark.slow
def test_nothing_tells_a_model_from_itself(tilted):
    assert told((tilted[0], tilted[0]), next_drives(sets_of(tilted[:1]))) is None


@pytest.mark.slow
def test_load_or_currents_separate_weak_motor_and_tachogenerator(model):
    neutral = model.having(WeakMotor(g=0.0, wheel=2)).having(TachoScale(e=0.0, wheel="ml"))
    task = logged(neutral.having(WeakMotor(g=0.25, wheel=2)), neutral)
    gains = {WEAK: parameter(neutral, f"{WEAK}.g", 0.02), TACHO: parameter(neutral, f"{TACHO}.e", 0.015)}
    fits = []
    for freed in (WEAK, TACHO):
        also = [dataclasses.replace(gain, prior=name != freed) for name, gain in gains.items()]
        fits.append(fitted(task, neutral, also=also))
    proposal = told(fits, next_drives(sets_of(fits, (WEAK, TACHO))))
    assert any(word in proposal.what for word in ("current", "slope", "ballast", "wheel ml"))
    assert proposal.channel in ("wheel_rate_ml", "current_ml_A")
