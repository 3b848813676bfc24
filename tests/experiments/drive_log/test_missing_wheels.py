"""A log in which a wheel's rate or current is not recorded: the others are checked, compared and fitted."""

import csv

import numpy as np
import pytest

from rover_pin.experiments.drive_log.checks.log import faults, findings
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.experiments.drive_log.odometry_rival import odometry_baselines
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.rover.rover import load_rover
from tests.experiments.drive_log import drive_channels as channels
from tests.experiments.drive_log import drive_sets


def without(run, *names):
    return {name: values for name, values in run.items() if not name.startswith(names)}


@pytest.mark.parametrize("kind", ["no column", "no number", "most of it lost"])
def test_a_rate_that_is_not_recorded_is_a_finding_and_not_compared(kind):
    lost = np.array(channels.GOOD[0]["wheel_rate_ml"])
    lost[: None if kind == "no number" else 1000] = np.nan
    runs = [{**without(run, "wheel_rate_ml"), **({} if kind == "no column" else {"wheel_rate_ml": lost})}
            for run in channels.GOOD]  # fmt: skip
    log = channels.log_of(*runs)
    assert faults(log) == ()
    (finding,) = [finding for finding in findings(log) if "rate of ml" in finding.what]
    assert "not compared" in finding.todo
    compared = logged_run(log.runs[0], load_rover("nexus6"))
    observed = dict(zip(compared.channels, compared.observed, strict=True))
    assert np.isfinite(observed["wheel_rate_fl"]).mean() > 0.5
    assert "wheel_rate_ml" not in observed or np.isfinite(observed["wheel_rate_ml"]).mean() < 0.5


def test_rates_of_one_side_alone_are_too_few():
    log = channels.log_of(*(without(run, "wheel_rate_fr", "wheel_rate_mr", "wheel_rate_rr") for run in channels.GOOD))
    assert any("wheel_rate_fr" in fault.what for fault in faults(log))


def test_a_wheel_without_a_rate_turns_as_its_side_where_rates_are_the_input():
    runs = [without(run, "duty_", "current_", "wheel_rate_ml") for run in channels.GOOD]
    log = channels.log_of(*runs, motor={})
    assert faults(log) == ()
    assert any(
        "rate of ml" in finding.what and "mean rate of the other wheels" in finding.todo for finding in findings(log)
    )
    rover = load_rover("nexus6")
    rate = logged_run(log.runs[0], rover).commands.rate
    at = {wheel.name: number for number, wheel in enumerate(rover.wheels)}
    assert rate[:, at["ml"]] == pytest.approx(0.5 * (rate[:, at["fl"]] + rate[:, at["rl"]]), abs=1e-6)
    assert np.ptp(rate[:, at["ml"]]) > 0.1


def test_five_of_six_rates_and_currents_are_fitted(tmp_path):
    """Simulated with a shear modulus 1.15 times the declared one: all channels that are left go into the fit."""
    folder = drive_sets.write(tmp_path, runs=2, duration=6.0)
    for file in folder.glob("run-*.csv"):
        rows = list(csv.reader(file.read_text().splitlines()))
        keep = [at for at, name in enumerate(rows[0]) if name not in ("wheel_rate_mr", "current_fl_A")]
        with file.open("w", newline="") as out:
            csv.writer(out).writerows([row[at] for at in keep] for row in rows)
    log = read_drive_log(folder)
    assert faults(log) == ()
    fit = drive_sets.calibrated_on(log, with_spread(base_model(log)))
    names = fit.task.experiment.channels
    assert {"wheel_rate_mr", "current_fl_A"}.isdisjoint(names)
    assert {"wheel_rate_ml", "current_fr_A"} <= set(names)
    assert odometry_baselines(fit.task.experiment, load_rover("nexus6"))
