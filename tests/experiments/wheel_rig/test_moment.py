"""The moment about the vertical of a wheel at a slip angle: against a sum of r x F, in fits, as read and as checked."""

import dataclasses

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin import Soil, Wheel, close_the_loop
from rover_pin.base.errors import DataError
from rover_pin.cli.app import app
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.experiments.wheel_rig.checks import findings, repeats
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import ASKEW, RigModel
from rover_pin.measurements.rig_physics import refuse_impossible, suspicions
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated
from tests.oracle import askew_wheel as oracle

WHEEL = Wheel(0.0625, 0.06)
SOIL = Soil(k=0.008, phi=0.4, c=50.0, n=1.2, k_1=8e4, k_2=0.0, exit_ratio=0.15)
TRUE = oracle.AskewWheel(0.0625, 0.06, 50.0, 0.4, 0.008, 8e4, 1.2, 0.15)
CHANNELS = {
    "drawbar_pull_N": (0.25, "N"),
    "torque_Nm": (0.015, "N m"),
    "sinkage_m": (0.0004, "m"),
    "lateral_N": (0.25, "N"),
    "moment_z_Nm": (0.004, "N m"),
}
SDS = [sd for sd, _ in CHANNELS.values()]
SLIPS, ANGLES = (0.0, 0.2, 0.4, 0.7), (0.15, 0.4, 0.8)
RUNS = [(S, angle) for S in SLIPS for angle in ANGLES]
TOML = """kind = "wheel-rig"
name = "askew"
files = { points = "points.csv" }
[wheel]
r = { value = 0.0625, unit = "m" }
b = { value = 0.06, unit = "m" }
[soil]
n = { value = 1.2 }
c = { value = 50.0, unit = "Pa" }
"""


def rows(wheel=TRUE, seed=0):
    """Slip, slip angle, load and the channels of all runs, with noise."""
    noise = np.random.default_rng(seed).normal(size=(len(RUNS), 5)) * SDS
    return np.array([(S, angle, 25.0, *wheel.run(25.0, S, angle)) for S, angle in RUNS]) + np.pad(
        noise, ((0, 0), (3, 0))
    )


CLEAN = rows()


def written(folder, table=CLEAN, leave=(), toml=""):
    folder.mkdir(exist_ok=True)
    names = ["slip", "slip_angle_rad", "load_N", *CHANNELS]
    stored = [at for at, name in enumerate(names) if name not in leave]
    lines = [",".join(names[at] for at in stored), *(",".join(f"{row[at]:.9g}" for at in stored) for row in table)]
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    noise = [
        f'{name.rpartition("_")[0]} = {{ value = {sd}, unit = "{unit}" }}' for name, (sd, unit) in CHANNELS.items()
    ]
    (folder / "rig.toml").write_text(f"{TOML}{toml}[noise]\n" + "\n".join(noise) + "\n")
    return folder


def fitted(folder):
    """Name -> (value, SD) of all that is uncertain of a set."""
    data = read_rig_set(folder)
    experiment = RigExperiment((data,))
    model = RigModel(data.wheel, data.soil(), ASKEW, data.errors)
    fit = calibrated(experiment, model, experiment.uncertain(model))
    sd = np.sqrt(np.diag(np.linalg.inv(fit.columns.T @ fit.columns)))
    rows = zip(fit.parameters, fit.u, sd, strict=True)
    return {
        parameter.name: (float(fit.value(parameter.name)), spread * abs(parameter.slope(u)))
        for parameter, u, spread in rows
    }


# --- the law ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("S", [-0.5, 0.0, 0.3, 0.8])
@pytest.mark.parametrize("flank", [0.0, 2.0])
def test_all_channels_are_those_of_forces_summed_as_vectors(S, flank):
    """r x F over rim and flank, by a sum that shares no code: of either sign of the angle, the flank's moment none."""
    hidden = oracle.AskewWheel(0.0625, 0.06, 50.0, 0.4, 0.008, 8e4, 1.2, 0.15, flank, 0.02)
    model = RigModel(WHEEL, SOIL, (*ASKEW, FlankPressure(flank, 0.02)))
    for angle in (0.1, -0.5, 1.0):
        prediction = model.predict(25.0, S, slip_angle=angle)
        expected = hidden.run(25.0, S, angle)
        channels = [float(channel[0]) for channel in prediction]
        assert channels[:5] == pytest.approx(expected, rel=5e-5)
        # A motor without a scale or a zero of its own has the torque of the axle.
        assert channels[5:] == [float(prediction.torque[0])]
        assert np.sign(expected[4]) == np.sign(angle), "to its left where it goes to its right: further askew"
        alone = TRUE.run(25.0, S, angle)[4]
        assert expected[4] == pytest.approx(alone, rel=1e-6)


def test_the_side_force_acts_ahead_of_the_axle_in_the_contact():
    predictions = [
        RigModel(WHEEL, SOIL, ASKEW).predict(25.0, SLIPS, slip_angle=angle) for angle in np.radians([5, 15, 30, 45, 70])
    ]
    arms = np.array([forces.moment / forces.side_force for forces in predictions])
    ends = np.sqrt(WHEEL.r**2 - (WHEEL.r - np.array([forces.sinkage for forces in predictions])) ** 2)
    assert np.all((ends / 6.0 < arms) & (arms < ends / 3.0))


def test_what_scales_the_side_force_scales_its_moment():
    for effect in (PostPeak(0.4), RateDependence(0.2)):
        plain, scaled = (
            RigModel(WHEEL, SOIL, effects).predict(25.0, 0.5, slip_angle=0.4) for effects in (ASKEW, (*ASKEW, effect))
        )
        assert scaled.moment / plain.moment == pytest.approx(scaled.side_force / plain.side_force)
        assert abs(scaled.moment / plain.moment - 1.0) > 0.1


# --- in fits ---------------------------------------------------------------------------------------------------------


def test_the_moment_tells_where_the_contact_ends(tmp_path):
    """The arm of the side force is that of the contact: the exit ratio is told half as far off as without."""
    full, without = (
        fitted(written(tmp_path / name, leave=left)) for name, left in (("a", ()), ("b", ("moment_z_Nm",)))
    )
    truth = {"soil.k": 0.008, "soil.phi": 0.4, "soil.k_1": 8e4, "soil.exit_ratio": 0.15}
    for name, value in truth.items():
        assert full[name][0] == pytest.approx(value, abs=3.0 * full[name][1])
        assert full[name][1] < without[name][1]
    assert full["soil.exit_ratio"][1] < 0.7 * without["soil.exit_ratio"][1]


def test_cell_ahead_of_the_axle_is_found_as_a_rig_error(tmp_path):
    table = CLEAN.copy()
    side = np.array([TRUE.run(25.0, S, angle)[3] for S, angle in RUNS])
    table[:, 7] += 0.03 - 0.02 * side
    toml = '[rig]\nmoment_arm = { value = 0.0, sd = 0.03, unit = "m" }\n'
    toml += 'moment_tare = { value = 0.0, sd = 0.05, unit = "N m" }\n'
    rig_fit = fitted(written(tmp_path / "set", table, toml=toml))
    for name, value in {"rig.moment_arm": 0.02, "rig.moment_tare": 0.03, "soil.phi": 0.4}.items():
        assert rig_fit[name][0] == pytest.approx(value, abs=3.0 * rig_fit[name][1])
    assert rig_fit["rig.moment_arm"][1] < 0.001


@pytest.mark.nightly
def test_the_loop_fits_holds_out_and_draws_it(tmp_path):
    verdict = close_the_loop(written(tmp_path / "set"), out=tmp_path / "out")
    assert verdict.answer.value == "no effect needed"
    score = next(score for score in verdict.scores if score.name == "moment about the vertical")
    assert score.unit == "N m"
    assert score.after < 1.5 * CHANNELS["moment_z_Nm"][0]
    assert "moment about the vertical" in (tmp_path / "out" / "report.html").read_text()
    assert (tmp_path / "out" / "channels-5.png").exists()


# --- as read ---------------------------------------------------------------------------------------------------------


def test_it_is_read_where_a_wheel_runs_askew_with_its_noise(tmp_path):
    rig = read_rig_set(written(tmp_path / "set"))
    moment = rig.channels[-1]
    assert (moment.column, moment.unit, moment.sd[0]) == ("moment_z_Nm", "N m", 0.004)
    assert moment.measured == pytest.approx(CLEAN[:, 7], rel=1e-8)
    straight = CLEAN.copy()
    straight[:, 1] = 0.0
    assert [channel.column for channel in read_rig_set(written(tmp_path / "straight", straight)).channels] == [
        "drawbar_pull_N", "torque_Nm", "sinkage_m",
    ]  # fmt: skip
    bare = written(tmp_path / "bare")
    (bare / "rig.toml").write_text((bare / "rig.toml").read_text().replace("moment_z = ", "# "))
    with pytest.raises(DataError, match=r"\[noise\] moment_z"):
        read_rig_set(bare)
    points = bare / "points.csv"
    points.write_text(points.read_text().replace("moment_z_Nm", "moment_z_Nmm"))
    with pytest.raises(DataError, match=r"'moment_z_Nmm'.*'moment_z_Nm'"):
        read_rig_set(bare)


# --- as checked ------------------------------------------------------------------------------------------------------


def with_moment(rig, measured, sd=None):
    channels = [channel for channel in rig.channels if channel.column != "moment_z_Nm"]
    channel = next(channel for channel in rig.channels if channel.column == "moment_z_Nm")
    return dataclasses.replace(rig, channels=(*channels, type(channel)(measured, channel.sd if sd is None else sd)))


def test_moment_outside_the_wheel_is_named_and_frozen_refused(tmp_path):
    rig = read_rig_set(written(tmp_path / "set"))
    assert not [suspicion for suspicion in suspicions(rig) if "moment_z" in str(suspicion)]
    moment, side = CLEAN[:, 7], CLEAN[:, 6]
    for shift, word in ((0.15, "ahead of"), (-0.15, "behind")):
        (suspicion_text,) = [
            str(suspicion)
            for suspicion in suspicions(with_moment(rig, moment + shift * side))
            if "moment_z" in str(suspicion)
        ]
        assert f"m {word} the axle, beyond the rim" in suspicion_text
        assert "state moment_arm in [rig]" in suspicion_text
    few_outliers = with_moment(rig, moment + 0.15 * side)
    noisy = with_moment(rig, moment + 0.15 * side, 1.0)
    assert [suspicion for suspicion in suspicions(few_outliers) if "moment_z" in str(suspicion)]
    assert not [suspicion for suspicion in suspicions(noisy) if "moment_z" in str(suspicion)], "within its noise"
    with pytest.raises(DataError, match=r"moment_z_Nm is .* times"):
        refuse_impossible(with_moment(rig, 1e3 * moment))
    frozen = CLEAN.copy()
    frozen[:, 7] = 0.01
    folder = written(tmp_path / "frozen", frozen)
    with pytest.raises(DataError, match=r"moment_z_Nm.*0\.01.*12 runs"):
        close_the_loop(folder)


def test_runs_at_other_slip_angles_are_no_repeats(tmp_path):
    """They were: a set without a column `level` was told that its repeats scatter many times its noise."""
    data = read_rig_set(written(tmp_path / "set"))
    assert repeats(data).tolist() == list(range(12))
    assert not [
        finding
        for finding in findings(RigExperiment((data,)))
        if "repeats scatter" in str(finding) or "from its repeats" in str(finding)
    ]
    again = CLEAN.copy()
    again[:, 1] += 0.001 * np.random.default_rng(1).normal(size=12)
    both = read_rig_set(written(tmp_path / "twice", np.vstack([CLEAN, again])))
    assert repeats(both).tolist() == [*range(12), *range(12)]
    completed = CliRunner().invoke(app, ["check-data", str(tmp_path / "set")])
    assert "no level is repeated" in completed.output
