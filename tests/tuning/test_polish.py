"""The polish on the full rover: lower by the score that decides, also where slopes say nothing."""

import dataclasses

import numpy as np
import pytest

from rover_pin.control.slip_control import Gains
from rover_pin.scenarios.sensitivities import course_of, drive_along
from rover_pin.tuning.drive_score import score_trace
from rover_pin.tuning.drives import Control, build, controller_of, full_score
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.study import DriveCase, Effort, SlipLaw, TuningStudy
from rover_pin.tuning.trust import MAX_SLIP_ERROR, check_drives
from rover_pin.tuning.tune import SearchPoint, place_of, polish, tune_gains

LOOSE = (("soil", "table-1"), ("effect.MotionResistance.R", 0.028), ("soil.k", 0.01))
DITCH = DriveCase("ditch", "ditch", (("duration", 14.0), *LOOSE, ("terrain.wall_angle_deg", 40.0)))
STUDY = TuningStudy("ditch", (DITCH,), free={"k_p": (0.01, 10.0), "S_d": (0.05, 0.9)}, effort=Effort(steps=8, keep=1))
SANDY = (("duration", 40.0), ("add", "DiggingMemory.c_d=0.05"), ("soil.k", 0.014), ("soil.phi_deg", 30.0))
CHAOTIC = DriveCase("ditch 36 deg", "ditch", (*SANDY, ("terrain.wall_angle_deg", 36.0)))


def cost_of(law):
    return float(STUDY.cost.choice(np.array([full_score(DITCH, Control.of("true", law))])))


@pytest.fixture(scope="module")
def polished():
    evaluations = Evaluations(None, 1, None)
    middle = STUDY.law([0.5, 0.15])
    assert check_drives(STUDY, evaluations, middle)[0].slip > MAX_SLIP_ERROR, "the reduced model is right here"
    return polish(STUDY, evaluations, SearchPoint(place_of(STUDY, middle), 0.0, "search")), evaluations


def test_a_polish_lowers_what_the_full_rover_decides_by(polished):
    point, _ = polished
    assert point.before == pytest.approx(cost_of(STUDY.law([0.5, 0.15])), rel=1e-12)
    assert point.cost == pytest.approx(cost_of(STUDY.law(point.place)), rel=1e-12)
    assert point.cost < point.before - 1e-3


def test_a_polish_drives_as_often_as_it_may(polished):
    assert polished[1].fresh == 1 + STUDY.effort.steps


def test_a_polish_reads_sensors_and_holes_too():
    """A control that no reduced model knows; the result says what the polish brought."""
    short = dataclasses.replace(DITCH, settings=(("duration", 3.0), *DITCH.settings[1:]))
    effort = Effort(population=5, generations=0, starts=1, steps=3, keep=1)
    result = tune_gains(dataclasses.replace(STUDY, training=(short,), estimate="onboard", effort=effort), workers=1)
    _, search, last = result.candidates
    assert (search.stage, last.stage) == ("search", "polish")
    assert last.cost <= search.cost
    assert f"{search.cost:.4f} to {last.cost:.4f}" in result.search_notes[-1]


@pytest.mark.slow
def test_slopes_of_a_long_ditch_hold_for_no_gains():
    """The reason for a polish without derivatives: two such drives part, and a slope is as large as its width small."""
    gains, slopes = Gains(k_p=2.3, k_i=0.068, S_d=0.39), []

    def scene(S_d):
        law = SlipLaw(gains.replace(S_d=S_d))
        return dataclasses.replace(build(CHAOTIC), controller=controller_of(CHAOTIC, Control.of("true", law)))

    middle = scene(gains.S_d)
    course = course_of(middle, middle.drive(measure_error=False))
    for width in (1e-2, 1e-6):
        ends = [
            score_trace(drive_along(scene(gains.S_d * (1 + side * width)), course), middle.model, 40.0).cost(STUDY.cost)
            for side in (1, -1)
        ]
        slopes.append((ends[0] - ends[1]) / (2 * width))
    assert abs(slopes[0]) < 3.0
    assert abs(slopes[1]) > 10.0 * abs(slopes[0])
