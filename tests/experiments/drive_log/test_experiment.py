"""The drive that tells two candidates apart: what is proposed, and that its expected chi2 is what a drive gives."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.contact import Soil
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.noise import first_noise, noise_of
from rover_pin.experiments.drive_log.candidate_runs import candidate_runs
from rover_pin.experiments.drive_log.candidates import candidate_of
from rover_pin.experiments.drive_log.discrimination import logged_instruments, predict_difference, with_currents
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.experiments.drive_log.separating_drive import SeparatingDrive, _choice, separating_drive
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motors import nexus6_motor
from rover_pin.simulation.replay import PERIOD, Commands, replay
from rover_pin.simulation.sensors import Sensors, measured
from rover_pin.simulation.start.place import Start, settled
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.traction import TorqueTraction
from rover_pin.terrain.shapes import flat

WEAK, TACHO = "WeakMotor[2]", "TachoScale[ml]"


@pytest.fixture(scope="module")
def model():
    rover, soil = load_rover("nexus6"), Soil().replace(k=0.005)
    effects = base_effects(soil, rover, SoilTraction(TorqueTraction(), FixedAngles()))
    return Model(rover, flat(), (soil,), nexus6_motor(), effects=effects)


def driven(model, commands, seed):
    """Return the log of a free drive, with the noise of the default sensors, without currents."""
    drive = replay(model, commands)
    wheels = [wheel.name for wheel in model.rover.wheels]
    duty = {f"duty_{name}": commands.duty[:, at] for at, name in enumerate(wheels)}
    trace = Trace({**drive.channels, **duty}, attrs={"start": dataclasses.asdict(commands.start)})
    log = measured(trace, Sensors(), seed, model.sensor_effects, with_current=False)
    return logged_run(log, model.rover)


def forward(model, seed, seconds=12.0):
    """Return the commands of a drive towards +x at duties that change."""
    t = PERIOD * np.arange(round(seconds / PERIOD))
    levels = np.random.default_rng(seed).uniform(0.45, 0.85, 4)[np.arange(len(t)) * 4 // len(t)]
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in model.rover.wheels)))
    return Commands(t, np.repeat(levels[:, None], 6, axis=1), steer, np.full((len(t), 3), np.nan), Start())


def logged(truth, base):
    """Return two runs of a hidden truth as the task of fitting them, their noise known."""
    experiment = experiment_of([driven(truth, forward(truth, seed), seed) for seed in (1, 2)], base)
    left = experiment.observed - experiment.predict([truth])[0]
    least = np.full(len(experiment.channels), 1e-6)
    return Task(experiment, noise_of(left, first_noise(left, least).good, least))


def fitted(task, model, effect=None, name=None, also=()):
    """Return a fit of a few uncertain numbers and of one size of an effect."""
    having = model if effect is None else model.having(effect)
    free = [parameter(having, "soil.phi", math.radians(2.0)), parameter(having, "motor.gear", 0.04, log=True)]
    free += [parameter(having, "motor.resistance", 0.04, log=True), *also]
    return fit(task, having, [*free, *([candidate_of(effect).size(name)] if name else [])])


@pytest.fixture(scope="module")
def tilted(model):
    """Return a tilted table driven in one direction only, fitted as that and as a tether."""
    task = logged(model.having(GravityTilt(rise_x=0.015)), model)
    return (
        fitted(task, model, GravityTilt(rise_x=0.01), "GravityTilt.rise_x"),
        fitted(task, model, TetherDrag(f_0=0.5, f_1=0.0), "TetherDrag.f_0"),
    )


def run_called(fits, words):
    return next(run for run in _choice(("a", fits[0]), ("b", fits[1])) if words in run.label)


@pytest.fixture(scope="module")
def back(tilted):
    instruments = logged_instruments(tilted[0])
    return predict_difference(run_called(tilted, "flat towards -x"), tilted, instruments.names), instruments


def dense(rows, doubt):
    return float(rows @ np.linalg.solve(np.eye(len(rows)) + doubt @ doubt.T, rows))


def test_expected_information_is_that_of_whole_matrices(back):
    one, instruments = back
    rows = [one.experiment.channels.index(name) for name in instruments.names]
    noise = instruments.noise(one.moving[0])
    assert np.array_equal(*one.moving)
    expected = dense(noise.white(one.difference[:, rows]), noise.white(one.uncertainties[:, :, rows]).T)
    assert one.expected_chi2(instruments)[0] == pytest.approx(expected, rel=1e-6)
    assert 0.0 < expected < one.plain(instruments)


def test_a_tilt_is_told_from_a_tether_by_the_other_heading(tilted, back):
    one, instruments = back
    same = predict_difference(run_called(tilted, "flat towards +x"), tilted, instruments.names)
    assert one.expected_chi2(instruments)[0] > max(9.0, 10.0 * same.expected_chi2(instruments)[0])


def gain(one, instruments, truth, seed):
    """Return how much more chi2 the wrong model has than the true one when the drive is made, both free to move."""
    run = driven(one.models[truth], one.run.commands(one.models[truth].rover), seed)
    experiment = experiment_of([run], one.models[0])
    assert experiment.channels == instruments.names
    noise, count = instruments.noise(run.usable), len(one.fits[0].u)
    doubts = [noise.white(part).T for part in (one.uncertainties[:count], one.uncertainties[count:])]
    left = [noise.white(experiment.observed - features) for features in experiment.predict(one.models)]
    chi2 = [dense(rows, doubt) for rows, doubt in zip(left, doubts, strict=True)]
    return chi2[1 - truth] - chi2[truth]


def test_expected_chi2_is_that_of_the_drive_under_either_truth(back):
    one, instruments = back
    found = [np.mean([gain(one, instruments, truth, seed) for seed in (20, 21)]) for truth in (0, 1)]
    assert 0.5 < min(found) / one.expected_chi2(instruments)[0] < 2.0


def test_unlogged_currents_are_read_no_better_than_by_a_sensor(tilted):
    logged_ones = logged_instruments(tilted[0])
    richer = with_currents(logged_ones, ("fl", "fr"))
    assert richer.names[-2:] == ("current_fl_A", "current_fr_A")
    assert np.all(richer.sd[-2:] >= Sensors().current_sd)
    assert with_currents(richer, ("fl", "fr")).names == richer.names


def test_what_holds_at_every_duty_needs_currents(model):
    task = logged(model.having(GearFriction(tau_c=0.06)), model)
    fits = (
        fitted(task, model, GearFriction(), "GearFriction.tau_c"),
        fitted(task, model, DeadBand(), "DeadBand.delta_0"),
    )
    assert fits[0].chi2 == pytest.approx(fits[1].chi2, abs=4.0)
    logged_ones = logged_instruments(fits[0])
    richer = with_currents(logged_ones, [wheel.name for wheel in model.rover.wheels])
    one = predict_difference(run_called(fits, "flat, the duty stepping"), fits, richer.names)
    told, channel = one.expected_chi2(richer)
    assert told > 9.0 > one.expected_chi2(logged_ones)[0]
    assert channel.startswith("current_")


def test_every_run_of_the_menu_is_said_once_and_within_the_duty(model):
    runs = candidate_runs(model.rover, 0.6, Start(), (2,))
    assert len({run.label for run in runs}) == len(runs) >= 12
    assert all(np.abs(run.duty).max() <= 1.0 for run in runs)
    alone = next(run for run in runs if "wheel ml" in run.label)
    others = np.delete(alone.duty, 2, axis=1)
    assert np.ptp(others) == 0.0
    assert np.all(alone.duty[:, 2] != others[:, 0])


def test_ballast_is_common_and_rests_at_the_centre_of_mass(model):
    run = next(run for run in candidate_runs(model.rover, 0.6, Start()) if run.ballast)
    mass = sum(inertia.mass for inertia in model.rover.model.inertias)
    assert run.ballast == pytest.approx(0.2 * mass, abs=0.06)
    bare, heavy = (settled(each, Start()) for each in (model, run.on(model)))
    assert bare.q[2] > heavy.q[2]


def test_an_effect_at_a_place_is_sought_on_the_logged_ground(tilted):
    patched = dataclasses.replace(tilted[1], model=tilted[1].model.having(HardPatch(x_from=0.3)))
    runs = _choice(("GravityTilt", tilted[0]), ("HardPatch@0.30", patched))
    assert runs
    assert all(run.terrain is None for run in runs)


def test_the_sentences():
    found = SeparatingDrive("A", "B", "on the flat at a constant duty of 0.50", "wheel_rate_fl", 26.6)
    assert found.sentence == (
        "to tell A from B: 20 s on the flat at a constant duty of 0.50; "
        "wheel_rate_fl shows it most (expected chi2 26.6)"
    )


@pytest.mark.slow
def test_the_menu_is_searched_for_a_tilt_and_a_tether(tilted):
    said = []
    found = separating_drive(("GravityTilt", tilted[0]), ("TetherDrag", tilted[1]), said.append)
    assert "-x" in found.run or "back" in found.run
    assert found.expected > 9.0
    assert found.expected >= found.runner_up_expected
    assert found.run != found.runner_up
    assert len(said) >= 16


@pytest.mark.slow
def test_nothing_separates_a_model_from_itself(tilted):
    assert separating_drive(("A", tilted[0]), ("B", tilted[0])) is None


@pytest.mark.slow
def test_load_or_currents_separate_weak_motor_and_tachogenerator(model):
    neutral = model.having(WeakMotor(g=0.0, wheel=2)).having(TachoScale(e=0.0, wheel="ml"))
    task = logged(neutral.having(WeakMotor(g=0.25, wheel=2)), neutral)
    gains = {WEAK: parameter(neutral, f"{WEAK}.g", 0.02), TACHO: parameter(neutral, f"{TACHO}.e", 0.015)}
    fits = []
    for freed in (WEAK, TACHO):
        also = [dataclasses.replace(each, prior=name != freed) for name, each in gains.items()]
        fits.append(fitted(task, neutral, also=also))
    found = separating_drive((WEAK, fits[0]), (TACHO, fits[1]))
    assert any(word in found.run for word in ("current", "slope", "ballast", "wheel ml"))
    assert found.channel in ("wheel_rate_ml", "current_ml_A")
