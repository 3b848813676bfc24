"""What a tracker and a logger make of a drive: outlying poses are left out, doubtful steps too, wander is learnt."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Trace, load_rover
from rover_pin.experiments.drive_log.checks.log import findings
from rover_pin.experiments.drive_log.excluded_rows import (
    JUMPS,
    AmbiguousStep,
    ambiguous_steps,
    later_duties,
    pose_outliers,
    without_pose_outliers,
)
from rover_pin.experiments.drive_log.features import AFTER_TURN, LEAK, LoggedRun, in_whole_gaps, logged_run
from rover_pin.experiments.drive_log.random_effects import COURSE, HEIGHT, PLACE, TILT, TRACKER, tracker_columns
from tests.experiments.drive_log import drive_channels as channels

GOOD, changed, log_of = channels.GOOD, channels.changed, channels.log_of
T, X = GOOD[0]["t_s"], GOOD[0]["body_x"]


def with_poses_off(*rows, size=0.05):
    x = X.copy()
    x[list(rows)] += size
    return changed(body_x=x)


# --- outlying poses -------------------------------------------------------------------------------------------------


def test_coarse_tracker_noise_is_no_outlier_a_distant_pose_is():
    """Two million poses with noise of five times the least distance that strays."""
    x = 0.025 * np.random.default_rng(5).standard_normal(2_000_000)
    t = 0.01 * np.arange(len(x))
    assert not pose_outliers(Trace({"t_s": t, "body_x": x})).any()
    x[1000] = 0.025 * 9.0
    assert np.flatnonzero(pose_outliers(Trace({"t_s": t, "body_x": x}))).tolist() == [1000]


@pytest.mark.parametrize("name", JUMPS)
def test_pose_with_one_wrong_number_is_an_outlier_as_a_whole(name):
    values = GOOD[0][name].copy()
    values[300] -= 0.1
    log = changed(**{name: values}).runs[0]
    assert np.flatnonzero(pose_outliers(log)).tolist() == [300]
    left = without_pose_outliers(log)
    assert all(np.flatnonzero(np.isnan(left[jump])).tolist() == [300] for jump in JUMPS)
    assert np.array_equal(left["wheel_rate_fl"], log["wheel_rate_fl"])


def test_jumps_turns_over_pi_and_rows_far_apart_do_not_stray():
    x = X + 0.1 * (T > 20.0)
    yaw = math.pi + 0.01 * np.sign(np.sin(3.0 * T))
    wrapped = (yaw + math.pi) % (2 * math.pi) - math.pi
    assert not pose_outliers(changed(body_x=x, body_yaw=wrapped).runs[0]).any()
    slow = Trace({"t_s": np.arange(20.0), "body_x": np.where(np.arange(20) == 10, 1.0, 0.0)})
    assert not pose_outliers(slow).any()
    assert not pose_outliers(Trace({"t_s": np.arange(3.0), "body_x": np.zeros(3)})).any()


def test_a_pose_beside_a_gap_is_told_by_those_on_its_other_side():
    x = np.where((T > 10.0) & (T < 10.6), np.nan, X)
    rows = np.flatnonzero(np.isnan(x))
    before, after = int(rows[0] - 1), int(rows[-1] + 1)
    assert not pose_outliers(changed(body_x=x).runs[0]).any()
    x[[before, after]] += 0.05
    assert np.flatnonzero(pose_outliers(changed(body_x=x).runs[0])).tolist() == [before, after]


def test_outliers_are_reported_with_times_and_not_as_jumps():
    finding_texts = [str(line) for line in findings(with_poses_off(300))]
    (line,) = [line for line in finding_texts if "outlier" in line]
    assert line.startswith(
        "run-1.csv: a single pose is an outlier among those before and after, at t = 12 s (row 301); "
    )
    assert "1 of 1500" in line
    assert not any("jumps" in line for line in finding_texts)
    many = [str(line) for line in findings(with_poses_off(*range(100, 170, 10)))]
    assert any("outlier" in line and "7 of 1500" in line for line in many)


# --- steps of the duty ------------------------------------------------------------------------------------------------

EVEN = np.arange(0.0, 10.0, 0.05)
STEPPED = np.where(EVEN < 5.0, 0.4, 0.6)


def duties(t, duty, **more):
    return Trace({"t_s": t, "duty_fl": duty, "wheel_rate_fl": 2.0 * duty, **more})


def uneven(seed=0):
    return EVEN + np.random.default_rng(seed).uniform(-0.015, 0.015, len(EVEN))


def test_between_uneven_rows_it_is_somewhere():
    t = uneven()
    (ambiguous_step,) = ambiguous_steps(duties(t, STEPPED))
    assert (ambiguous_step.begin, ambiguous_step.end, ambiguous_step.change) == (
        t[99],
        t[100],
        {"duty_fl": pytest.approx(0.2)},
    )


def test_where_rows_are_missing_it_is_anywhere_among_them():
    keep = (EVEN < 4.8) | (EVEN > 5.2)
    (ambiguous_step,) = ambiguous_steps(duties(EVEN[keep], STEPPED[keep]))
    assert (ambiguous_step.begin, ambiguous_step.end) == (pytest.approx(4.75), pytest.approx(5.25))
    elsewhere = (EVEN < 6.8) | (EVEN > 7.2)
    assert ambiguous_steps(duties(EVEN[elsewhere], STEPPED[elsewhere])) == []


def late(run, at=None):
    """The run with its rows uneven, or with a second missing about `at`."""
    t = run["t_s"] + np.random.default_rng(3).uniform(-0.012, 0.012, len(run["t_s"]))
    keep = np.ones(len(t), dtype=bool) if at is None else np.abs(run["t_s"] - at) > 0.4
    return {name: (t if name == "t_s" and at is None else values)[keep] for name, values in run.items()}


def test_blocks_at_ambiguous_steps_are_excluded_and_reported():
    log = log_of(late(GOOD[0]), *GOOD[1:])
    count = len(ambiguous_steps(log.runs[0]))
    assert count > 5
    even, rows = (logged_run(log_read.runs[0], load_rover("nexus6")) for log_read in (log_of(*GOOD), log))
    assert 0 < (even.usable & ~rows.usable[: len(even.usable)]).sum() <= 2 * count
    forward = rows.commands.duty.mean(axis=1) > 0.0
    turned = np.convolve(np.diff(forward, prepend=True), np.ones(round(AFTER_TURN / 0.05) + 2))[: len(forward)] > 0
    second = (rows.summed_rows != even.summed_rows) & ~turned
    assert np.mean(second) < 0.01, "what is driven there counts"
    assert (len(even.later), len(rows.later)) == (0, count)
    finding_texts = [str(finding) for finding in findings(log)]
    assert any(
        f"so the instants of {count} steps of the duty are unknown, by up to 0.0" in finding_text
        for finding_text in finding_texts
    ), finding_texts


def test_a_step_in_doubt_is_late_by_the_sd_of_its_instant():
    """The old duty of each wheel, in the rover's order of them, lasts 0.5 s / sqrt(12) longer than half-way."""
    t = 0.05 * np.arange(200)
    step = AmbiguousStep(4.75, 5.25, {"duty_b": 0.3, "duty_a": -0.1})
    duties = later_duties(step, SimpleNamespace(t=t, period=0.05), ("a", "b"))
    lasting = 0.5 / math.sqrt(12.0)
    assert duties.sum(axis=0) * 0.05 == pytest.approx([0.1 * lasting, -0.3 * lasting])
    acting = np.flatnonzero(duties.any(axis=1))
    assert (t[acting[0]], t[acting[-1]]) == (pytest.approx(5.05), pytest.approx(5.15))


def test_a_way_across_a_gap_counts_as_a_whole_or_not_at_all():
    """One line bridges it: where the rover stands in a part of the gap, the line drives there too."""
    missing = np.isin(np.arange(20), [4, 5, 6, 12, 13])
    counted = np.arange(20) > 4
    assert np.flatnonzero(~in_whole_gaps(counted, missing)).tolist() == [4, 5, 6, 7]


# --- a tracker that wanders -------------------------------------------------------------------------------------------


def wandering(names, seconds=20.0, skipped=()):
    t = np.arange(0.0, seconds, 0.05)
    counted = ~np.isin(np.arange(len(t)), skipped)
    commands = SimpleNamespace(t=t, period=0.05)
    return LoggedRun("", commands, names, np.zeros((len(names), len(t) // 10)), 0 * t, {}, counted, counted)


NAMES = ("path", "drift", "heading", "body_z", "body_roll", "body_pitch", "wheel_rate_fl")


def test_each_pose_number_wanders_alone_and_no_other_channel():
    columns = tracker_columns([wandering(NAMES)] * 2, NAMES, 40, np.zeros((2, len(NAMES), 40)))
    is_moved = columns["moved"].any(axis=3)
    assert is_moved.sum(axis=(1, 2)).tolist() == [1] * len(is_moved), "one run, one feature"
    rows = np.argwhere(is_moved)
    kinds = {NAMES[row]: TRACKER[columns["kind"][at]] for at, _, row in rows}
    assert kinds == {
        "path": PLACE, "drift": PLACE, "heading": COURSE, "body_z": HEIGHT, "body_roll": TILT, "body_pitch": TILT,
    }  # fmt: skip
    assert [fold for _, fold, _ in rows] == columns["fold"].tolist()


def test_the_first_step_is_a_zero_that_is_off():
    """Roll and pitch then read it, a height is levelled, and a way or a turn does not see it: nothing is moved."""
    columns = tracker_columns([wandering(NAMES)], NAMES, 40, np.zeros((1, len(NAMES), 40)))["moved"][:, 0]
    steps = {name: columns[columns[:, row].any(axis=1), row] for row, name in enumerate(NAMES)}
    assert {name: len(step) for name, step in steps.items()} == {
        "path": 5, "drift": 5, "heading": 5, "body_z": 5, "body_roll": 6, "body_pitch": 6, "wheel_rate_fl": 0,
    }  # fmt: skip
    assert steps["body_roll"][0] == pytest.approx(TILT.size * np.ones(40))


def test_a_place_that_is_off_lays_bumps_elsewhere():
    """Its zero too: what the rocker feels a metre further on stands for what a step ahead moves."""
    names, ahead = ("path", "rocker_l"), np.zeros((1, 2, 40))
    ahead[0, 1] = 0.3
    columns = tracker_columns([wandering(names)], names, 40, ahead)["moved"][:, 0]
    assert len(columns) == 6
    assert columns[0, 0] == pytest.approx(np.zeros(40), abs=1e-12)
    assert columns[0, 1] == pytest.approx(-0.3 * PLACE.size * np.ones(40))


def test_a_tracker_is_the_further_off_the_longer_it_walks():
    """A random walk: its variance is that of the steps so far, from 1 for the zero to 6 after five steps of 4 s."""
    columns = tracker_columns([wandering(("body_pitch",))], ("body_pitch",), 40, np.zeros((1, 1, 40)))["moved"]
    variance = np.sum((columns[:, 0, 0] / TILT.size) ** 2, axis=0)
    assert np.all(np.diff(variance) > 0)
    assert variance[0] == pytest.approx(1.0, abs=0.01)
    assert variance[-1] == pytest.approx(6.0, abs=0.2)


def test_a_place_that_wanders_evenly_is_a_way_that_is_forgotten():
    """x = v t through a leak of LEAK seconds: v LEAK (1 - exp(-t / LEAK))."""
    columns = tracker_columns([wandering(("path",), seconds=4.0)], ("path",), 8, np.zeros((1, 1, 8)))
    assert len(columns["moved"]) == 1
    t = np.arange(0.25, 4.0, 0.5)
    speed = PLACE.size / 3.95
    assert columns["moved"][0, 0, 0] == pytest.approx(speed * LEAK * (1 - np.exp(-t / LEAK)), abs=0.015 * PLACE.size)
