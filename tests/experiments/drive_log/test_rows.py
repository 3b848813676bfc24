"""Which rows of a drive log are compared and what is made of them, on made-up channels whose answers are plain."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.experiments.drive_log.candidates import candidate_of
from rover_pin.experiments.drive_log.experiment import neighbours
from rover_pin.experiments.drive_log.features import PATH, LoggedRun, comparable_rows, driven_features
from rover_pin.experiments.drive_log.free_runs import free_runs

T = np.arange(0.0, 12.0, 0.1)


def compared(rates, duty=0.5, is_held=False, t=T):
    """The times at which two wheels with these rates, and duties of one sign, are compared."""
    rows = [np.broadcast_to(rate, t.shape).astype(float) for rate in rates]
    run = SimpleNamespace(t=t, duty=np.broadcast_to(np.c_[duty, duty], (len(t), 2)), rate_driven=is_held)
    return t[comparable_rows(run, rows)]


@pytest.mark.parametrize(("rate", "duty"), [(0.19, 0.5), (-0.19, -0.5), (-1.0, 0.5), (1.0, -0.5)])
def test_standing_or_reversing_rover_is_compared_after_1_5_s(rate, duty):
    """Below 0.2 rad/s in the mean of its wheels, or against its duty; from 4 to 5 s."""
    direction = math.copysign(1.0, duty)
    row = np.where((T > 3.95) & (T < 5.05), rate, direction)
    is_compared = compared([row, row], duty)
    gap = np.diff(is_compared)
    assert is_compared[np.argmax(gap)] == pytest.approx(3.9)
    assert is_compared[np.argmax(gap) + 1] == pytest.approx(6.6)
    assert np.sum(gap > 0.15) == 1


@pytest.mark.parametrize(("default", "slow", "stands"), [(1.0, 0.09, True), (1.0, 0.11, False), (5.0, 0.21, False)])
def test_held_wheels_stand_below_a_tenth_of_their_fastest_speed(default, slow, stands):
    """And never above 0.2 rad/s; a rover that turns on the spot drives."""
    size = np.where((T > 3.95) & (T < 5.05), slow, default)
    is_compared = compared([size, -size], is_held=True)
    assert (np.max(np.diff(is_compared)) > 1.5) == stands


# --- what is made of the channels ------------------------------------------------------------------------------------


def test_path_and_drift_follow_the_heading_and_fade_in_2_s():
    heading = np.full(len(T), 0.3)
    along, across = 0.05, -0.02
    x = (along * math.cos(0.3) - across * math.sin(0.3)) * T
    y = (along * math.sin(0.3) + across * math.cos(0.3)) * T
    vx, vy = np.gradient(x, T), np.gradient(y, T)
    features = driven_features(
        {"body_x": x, "body_y": y, "body_yaw": 0.1 * T, "body_vx": vx, "body_vy": vy}, heading, 0.1, np.ones(len(T))
    )
    for name, speed in (("path", along), ("drift", across), ("heading", 0.1)):
        summed = sum(0.1 * speed * math.exp(-0.1 * k / 2.0) for k in range(len(T) - 1))
        assert features[name][-1] == pytest.approx(summed), name
        assert features[name][0] == 0.0
    assert features["speed"] == pytest.approx(np.full(len(T), along))
    assert set(driven_features({"body_yaw": T}, heading, 0.1, np.ones(len(T)))) == {"heading"}


def test_a_block_is_compared_where_all_its_rows_are():
    counted = np.ones(120, dtype=bool)
    counted[27] = False
    run = LoggedRun(
        "",
        SimpleNamespace(t=T, period=0.1, inertial=False),
        ("body_z", "none"),
        np.zeros((2, 24)),
        0 * T,
        {},
        counted,
        counted,
    )
    assert np.flatnonzero(~run.usable).tolist() == [5]
    height = np.where(counted, T, 1e3)
    features = run.features({"body_z": height})
    assert features[0][run.usable].mean() == pytest.approx(0.0, abs=1e-12)
    assert np.all(features[1] == 0.0), "what a replay does not tell stays still"
    assert run.times[:2] == pytest.approx([0.2, 0.7])


# --- places ----------------------------------------------------------------------------------------------------------


def patch(begin=1.0, length=0.3):
    return candidate_of(HardPatch(x_from=begin, length=length))


def test_patch_edges_move_both_ways_unless_too_little_remains():
    moved_patches = neighbours(patch(), 0.1)
    ends = [(neighbour.effect.x_from, neighbour.effect.x_from + neighbour.effect.length) for neighbour in moved_patches]
    assert ends == [pytest.approx(expected) for expected in ((0.9, 1.3), (1.1, 1.3), (1.0, 1.2), (1.0, 1.4))]
    assert [neighbour.place for neighbour in moved_patches] == ["0.900", "1.100", "1.000", "1.000"]
    assert len(neighbours(patch(length=0.149), 0.1)) == 2
    assert len(neighbours(patch(length=0.151), 0.1)) == 4
    assert neighbours(candidate_of(SupplySag()), 0.1) == []


# --- free runs -------------------------------------------------------------------------------------------------------


def test_a_free_run_strays_by_the_rms_of_its_distance():
    place = np.column_stack([0.05 * T, 0.02 * T, 0.0 * T])
    place[7] = np.nan
    run = SimpleNamespace(name="run-1", commands=SimpleNamespace(t=T, period=0.1, place=place))
    off = {"before": (0.3, -0.4), "after": (0.0, 0.1)}

    def replays(model):
        x, y = off[model]
        return [SimpleNamespace(channels={"body_x": 0.05 * T + x, "body_y": 0.02 * T + y})]

    experiment = SimpleNamespace(runs=(run,), channels=(PATH,), free=SimpleNamespace(replays=replays))
    (free_run,) = free_runs(experiment, "before", "after")
    assert (free_run.run, free_run.before, free_run.after) == ("run-1", pytest.approx(0.5), pytest.approx(0.1))
    assert free_run.distance == pytest.approx(math.hypot(0.05, 0.02) * 11.0)
    experiment.free = SimpleNamespace(replays=lambda model: [SimpleNamespace(channels={})])
    assert math.isnan(free_runs(experiment, "before", "after")[0].before)
