"""Circumstances of blind data sets (oracle/blind/circumstance): their shares, and each of them as it is stated."""

import importlib
import importlib.util
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from rover_pin.logs.drive_log import read_drive_log

HERE = Path(__file__).parent / "blind"
if "blind" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("blind", HERE / "__init__.py")
    sys.modules["blind"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["blind"])
circumstance, hidden, sealed = (
    importlib.import_module(f"blind.{name}") for name in ("circumstance", "hidden", "sealed")
)

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")


def rows_of_a_run(rate):
    t = 0.05 * np.arange(1, 401)
    names = ("body_x", "body_y", "body_z", "body_roll", "body_pitch", "body_yaw", "body_vx", "rocker_l", "steer_fl")
    turns = {f"wheel_rate_{wheel}": np.full(400, rate) for wheel in WHEELS}
    return {"t_s": t} | {name: np.sin(0.3 * t) for name in names} | turns


def test_a_tracker_drifts_slowly_and_from_where_it_starts():
    true = rows_of_a_run(1.0)
    read = [circumstance.read("drift", true, np.random.default_rng(seed)) for seed in range(60)]
    assert set(true) == set(read[0])
    for name, values in true.items():
        wander = np.array([run[name] - values for run in read])
        assert (name in circumstance.DRIFT) == bool(wander.any())
        if name in circumstance.DRIFT:
            assert not wander[:, 0].any()
            late = wander[:, 300:]  # against the start, as far off as two draws
            assert np.sqrt(np.mean(late**2)) == pytest.approx(np.sqrt(2) * circumstance.DRIFT[name], rel=0.25)
            assert np.abs(np.diff(wander)).max() < 0.1 * circumstance.DRIFT[name]


def test_a_coarse_encoder_loses_no_count_and_declares_its_noise():
    """The sum of the counts is the angle to within one count. The rates are whole counts, with the error that the log
    declares.
    """
    true = rows_of_a_run(1.1)
    true |= {f"wheel_rate_{wheel}": 1.1 + 0.3 * np.sin((1 + at) * true["t_s"]) for at, wheel in enumerate(WHEELS)}
    read, step = circumstance.read("coarse", true, np.random.default_rng(2)), 2 * np.pi / circumstance.COUNTS
    off = []
    for wheel in WHEELS:
        name = f"wheel_rate_{wheel}"
        counts = read[name] * 0.05 / step
        assert counts == pytest.approx(np.round(counts), abs=1e-6)
        assert np.abs(np.cumsum(0.05 * (read[name] - true[name]))).max() <= step * 1.001
        off.append(read[name] - true[name])
    declared = circumstance.noise("coarse")
    assert np.std(off) == pytest.approx(declared["wheel_rate"], rel=0.1)
    assert np.std(read["rocker_l"] - true["rocker_l"]) == pytest.approx(declared["angle"], rel=0.15)
    assert circumstance.read("plain", true, None) is true
    assert circumstance.noise("drift") == circumstance.noise("moon") == {}


@pytest.mark.slow
def test_a_log_declares_its_gravity_and_its_encoders(tmp_path):
    sets = [{"index": at, "kind": "none", "hidden": [], "under": name} for at, name in ((1, "moon"), (3, "coarse"))]
    sealed.generate(tmp_path / "sets", sets, 4, tmp_path / "answers.json", duration=0.5)
    moon, coarse = (read_drive_log(tmp_path / "sets" / f"set_{at:04d}") for at in (1, 3))
    assert moon.metadata.gravity == pytest.approx(1.62)
    assert coarse.metadata.gravity == pytest.approx(9.81)
    declared = tomllib.loads((coarse.folder / "drive.toml").read_text())["noise"]
    assert declared["wheel_rate"]["value"] == circumstance.noise("coarse")["wheel_rate"]
    answers = sealed.opened(tmp_path / "sets", tmp_path / "answers.json")["sets"]
    assert [answer["under"] for answer in answers] == ["moon", "coarse"]


def test_patchy_log_has_unannounced_gaps_and_single_wrong_poses():
    true, silent, blind, wrong = rows_of_a_run(1.1), [], [], []
    for seed in range(40):
        read = circumstance.read("patchy", true, np.random.default_rng(seed))
        rows = np.searchsorted(true["t_s"], read["t_s"])
        silent.append(400 - len(rows))
        assert {len(values) for values in read.values()} == {len(rows)}
        for name in ("wheel_rate_fl", "rocker_l", "steer_fl"):
            assert np.array_equal(read[name], true[name][rows])
        gap = np.isnan(read["body_x"])
        blind.append(gap.sum())
        assert np.array_equal(gap, np.isnan(read["body_vx"]))
        assert np.array_equal(read["body_vx"][~gap], true["body_vx"][rows][~gap])
        off = read["body_x"][~gap] - true["body_x"][rows][~gap]
        assert np.count_nonzero(off) <= circumstance.SPIKES[1]
        wrong += [*off[off != 0.0]]
    assert 0 < np.mean(silent) < max(circumstance.MISSED_S) / 0.05
    assert 0 < np.mean(blind) < 2 * max(circumstance.LOST_S) / 0.05
    assert np.std(wrong) == pytest.approx(circumstance.SPIKE["m"], rel=0.3)
    assert circumstance.noise("patchy") == {}
    assert np.isfinite(true["body_x"]).all()
