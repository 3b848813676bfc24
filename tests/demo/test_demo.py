"""Simulated data sets of the command demo: they are read like measured data, only the truth file states the hidden
effect, and the loop finds this effect.
"""

import json
import tomllib

import numpy as np
import pytest

from rover_pin.demo import drive_log, rig, slip_slope
from rover_pin.demo.hidden import truth_file
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.slip_slope import SlipSlope
from rover_pin.importing.import_log import import_log
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.measurements.rig_reading import read_rig_set


def test_only_the_truth_file_states_the_hidden_effect_of_a_rig(run, tmp_path):
    code, out, _ = run("demo", "rig", "--hidden", "SlipSinkage.n_1=0.7", "--out", "made")
    assert code == 0
    assert "SlipSinkage" not in out
    assert not [path for path in (tmp_path / "made").iterdir() if "SlipSinkage" in path.read_text()]
    assert tomllib.loads((tmp_path / "made-truth.toml").read_text())["hidden"] == "SlipSinkage.n_1=0.7"
    assert (
        json.loads(run("demo", "rig", "--out", "made", "--hidden", "nothing", "--tell", "--json")[1])["hidden"]
        == "nothing"
    )
    assert run("check-data", "made")[0] == 0


def test_a_rig_scatters_by_its_stated_noise(tmp_path):
    """Repeats of a level differ by the stated noise, and a hidden slip-sinkage lets the wheel sink deeper at large
    slip.
    """
    rig.write(tmp_path / "plain", "nothing", 1)
    rig.write(tmp_path / "deep", "SlipSinkage.n_1=0.7", 1)
    plain, deep = (read_rig_set(tmp_path / name) for name in ("plain", "deep"))
    for channel in plain.channels:
        levels = [channel.measured[plain.levels == level] for level in np.unique(plain.levels)]
        assert all(len(level) == 3 for level in levels)
        assert np.sqrt(np.mean([np.var(level, ddof=1) for level in levels])) == pytest.approx(channel.sd[0], rel=0.35)
    fast = plain.slip > 0.6
    assert np.mean(deep.channels[2].measured[fast]) > 1.5 * np.mean(plain.channels[2].measured[fast])


@pytest.mark.parametrize("rover", ["nexus6", "cart"])
def test_slopes_are_those_that_the_rover_climbs(tmp_path, rover):
    slip_slope.write(tmp_path / "set", "nothing", 2, rover)
    read = SlipSlope.read(tmp_path / "set")
    assert read.insufficient() == ""
    assert np.nanmax(read.observed) < 0.9
    slips = np.nanmean(read.observed[:, 0], axis=0)
    assert np.all(np.diff(slips) > 0.0)
    assert read.rover.name == rover


def test_a_drive_log_is_as_long_and_as_varied_as_the_loop_needs(tmp_path):
    demo = drive_log.write(tmp_path / "log", "WeakMotor.wheel=mr,g=0.3", 0)
    log = read_drive_log(tmp_path / "log")
    assert len(log.runs) == drive_log.RUNS
    assert demo.truth["hidden"].startswith("WeakMotor")
    assert not [name for name in log.runs[0].channels if name.startswith(("slip_", "sinkage_", "normal_"))]
    np.testing.assert_array_equal(log.runs[0]["duty_fl"], log.runs[4]["duty_fl"])
    assert np.std(log.runs[0]["body_x"] - log.runs[4]["body_x"]) > 0.0


def test_motors_and_tracker_of_a_synthetic_drive_are_imperfect(tmp_path):
    """Two logs with one seed are compared, one of them with equal motors, equal tachogenerators and a tracker without
    drift.
    """
    drive_log.write(tmp_path / "real", "nothing", 0)
    with pytest.MonkeyPatch.context() as exact:
        for name in ("DRIFT", "MOTOR_SD", "TACHO_SD"):
            exact.setattr(drive_log, name, 0.0)
        drive_log.write(tmp_path / "ideal", "nothing", 0)
    real, ideal = (read_drive_log(tmp_path / name).runs for name in ("real", "ideal"))
    wandered = np.array(
        [real_run["body_y"] - ideal_run["body_y"] for real_run, ideal_run in zip(real, ideal, strict=True)]
    )
    assert 2e-4 < np.std(wandered[:, -20:].mean(axis=1) - wandered[:, :20].mean(axis=1)) < 2e-2
    ratio = np.mean([real_run["wheel_rate_ml"] for real_run in real]) / np.mean(
        [real_run["wheel_rate_ml"] for real_run in ideal]
    )
    assert 1e-4 < abs(ratio - 1.0) < 0.04


def test_a_recording_is_imported_as_it_was_driven(tmp_path):
    """The importer finds each run and recovers the sensors' readings from the logger's names and units."""
    made = drive_log.write_recording(tmp_path / "made", "SupplySag.R_b=3", 0)
    assert "SupplySag" not in made.files[0].read_text()
    import_log(made.files, out=tmp_path / "log")
    log = read_drive_log(tmp_path / "log")
    # The same random numbers drive the same rover, in as many runs.
    random = np.random.default_rng(0)
    true, _ = drive_log.hidden_model(drive_log.declared_model("nexus6"), "SupplySag.R_b=3", random)
    driven = drive_log.measured_runs(true, random, drive_log.RECORDED_RUNS).values()
    assert len(log.runs) == drive_log.RECORDED_RUNS
    for imported, trace in zip(log.runs, driven, strict=True):
        for channel, error in (("wheel_rate_mr", 1e-4), ("current_rl_A", 1e-6), ("duty_fr", 1e-5), ("battery_V", 1e-3),
                               ("body_pitch", 1e-4), ("body_z", 1e-5)):  # fmt: skip
            np.testing.assert_allclose(imported[channel], trace[channel][-len(imported.t) :], atol=error)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nonsense",), "demo 'nonsense'"),
        (("rig", "--hidden", "SupplySag"), "SupplySag"),
        (("slip-slope", "--hidden", "Slip"), "effect 'Slip'"),
        (("rig", "--rover", "cart"), "A rig"),
        (("slip-slope", "--rover", "gone"), "rover 'gone'"),
    ],
)
def test_impossible_demos_are_refused_in_one_sentence(run, tmp_path, words, message):
    code, _, err = run("demo", *words)
    assert (code, err.count("\n")) == (2, 1)
    assert message in err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_loop_finds_the_hidden_effect_of_the_rig(run, tmp_path):
    assert run("demo", "rig", "--hidden", "SlipSinkage.n_1=0.7", "--out", "made")[0] == 0
    code, out, _ = run("close-loop", "made", "--json")
    assert code == 0
    verdict = json.loads(out)
    assert (verdict["answer"], verdict["effects"]) == (Answer.NAMED.value, ["SlipSinkage"])
    assert truth_file(tmp_path / "made").is_file()
