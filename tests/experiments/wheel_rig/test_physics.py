"""Nonsense in a rig set is refused or named, just beyond each limit and not within; real wheels raise no alarm."""

import dataclasses
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from rover_pin import SOILS, Soil, Wheel, wheel_forces
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, repeat_sd, too_poor
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import ASKEW, RigModel
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.rig_physics import refuse_impossible, suspicions
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from rover_pin.soil.sinkage import entry_angle, sinkage

DATA = Path(__file__).parents[3] / "studies" / "data"
SETS = sorted(file.parent.name for file in DATA.glob("*/rig.toml"))
CMU, DING = "cmu-smooth-wheel", "ding-2011-smooth"
SLIPS = np.array([-0.5, -0.2, 0.0, 0.1, 0.2, 0.4, 0.6, 0.8])


def changed(rig, kind=None, factor=1.0, load=1.0, r=1.0):
    """The set with a channel, the load or the radius multiplied."""
    channels = tuple(
        type(channel)(factor * channel.measured, abs(factor) * channel.sd)
        if isinstance(channel, kind or ())
        else channel
        for channel in rig.channels
    )
    wheel = rig.wheel.replace(r=float(rig.wheel.r) * r)
    return dataclasses.replace(rig, channels=channels, load=rig.load * load, wheel=wheel)


@pytest.mark.parametrize("name", SETS)
def test_real_wheels_raise_no_alarm(name):
    rig = read_rig_set(DATA / name)
    refuse_impossible(rig)
    assert suspicions(rig) == []


IMPOSSIBLE = [
    (DING, {"kind": Torque, "factor": -1.0}, "torque_Nm is negative at slips above 0.1, where the wheel drives"),
    (CMU, {"kind": Sinkage, "factor": -1.0}, "sinkage_m is negative .* by -1: positive is down"),
    (DING, {"load": 1.0 / 9.81}, "torque_Nm is 3.51 times the load times radius, more than any soil gives"),
    (DING, {"kind": Torque, "factor": 1e-3}, "gives out 313 times the work that its torque puts in"),
    (DING, {"r": 10.0}, "gives out 3.13 times the work .* and the wheel's r"),
    (CMU, {"kind": DrawbarPull, "factor": 1e3}, "drawbar_pull_N is 42.8 times the load, more than any soil gives"),
    (CMU, {"load": 1e7}, "load_N ranges from .*; give newtons"),
]
HARDLY_MEANT = [
    (CMU, {"kind": DrawbarPull, "factor": -1.0}, "falls with slip, from 1.02 to -1.16 N"),
    (DING, {"kind": DrawbarPull, "factor": -1.0}, "falls with slip, from -2.25 to -15 N"),
    (CMU, {"load": 100.0}, "drawbar_pull_N never exceeds 0.00073 times the load"),
    (DING, {"load": 100.0}, "torque_Nm at slips above 0.3 is 0.0041 times load times radius, less than any soil"),
    (CMU, {"load": 1.0 / 9.81}, "pressure over sinkage is 3.5e+04 Pa/m, softer than loose sand; check load_N (newtons"),
    (CMU, {"kind": Sinkage, "factor": 1e-3}, "stiffer than clay"),
    (CMU, {"r": 10.0}, "the wheel's width is 0.048 times its diameter"),
    (DING, {"kind": DrawbarPull, "factor": 6.0}, "drawbar_pull_N is 1.12 times the load in the median, more than sand"),
]


@pytest.mark.parametrize(("name", "change", "message"), IMPOSSIBLE)
def test_what_no_soil_gives_is_refused(name, change, message):
    data = read_rig_set(DATA / name)
    wrong = changed(data, **change)
    for refuse in (lambda: refuse_impossible(wrong), lambda: refuse_unfit(RigExperiment((wrong,)))):
        with pytest.raises(DataError, match=message):
            refuse()


@pytest.mark.parametrize(("name", "change", "message"), HARDLY_MEANT)
def test_what_is_hardly_meant_is_named(name, change, message):
    data = read_rig_set(DATA / name)
    wrong = changed(data, **change)
    if "times the load in" not in message:
        refuse_unfit(RigExperiment((wrong,)))
    finding_texts = [str(finding) for finding in findings(RigExperiment((wrong,)))]
    assert any(message in finding_text for finding_text in finding_texts), finding_texts
    assert all(message not in str(finding) for finding in findings(RigExperiment((data,))))


def test_a_wheel_gives_out_no_more_than_its_torque_puts_in():
    """At S = 0.5 a thrust of T / r = 10 N does 10 J over a metre of rim, and the wheel half a metre of pull."""
    rig = RigSet(
        Wheel(r=0.1, b=0.1), np.full(4, 0.5), 30.0, (DrawbarPull(np.full(4, 19.0), 0.1), Torque(np.ones(4), 0.01))
    )
    assert suspicions(rig) == []
    more = changed(rig, DrawbarPull, 1.1)
    refuse_impossible(more)
    assert "4 of 4 runs" in str(suspicions(more)[0])
    with pytest.raises(DataError, match=r"1\.52 times"):
        refuse_impossible(changed(rig, DrawbarPull, 1.6))


def test_single_rows_and_torques_that_cannot_be():
    rig = read_rig_set(DATA / CMU)
    pull = next(channel for channel in rig.channels if isinstance(channel, DrawbarPull))
    spoilt = pull.measured.copy()
    spoilt[3] = 1e308
    others = tuple(channel for channel in rig.channels if channel is not pull)
    with pytest.raises(DataError, match=r"drawbar_pull_N.*row 4"):
        refuse_impossible(dataclasses.replace(rig, channels=(DrawbarPull(spoilt, pull.sd), *others)))
    still = RigSet(Wheel(), np.array([0.2, 0.4, 0.6]), 10.0, (Torque(np.full(3, 5e-4), 1e-5),))
    with pytest.raises(DataError, match=r"\b0\.0011 times"):
        refuse_impossible(still)


def test_a_noise_that_no_sensor_has_is_refused():
    rig = read_rig_set(DATA / CMU)
    sunk = next(channel for channel in rig.channels if isinstance(channel, Sinkage))
    with pytest.raises(DataError, match=r"noise of sinkage_m is .*; state the SD"):
        refuse_impossible(dataclasses.replace(rig, channels=(Sinkage(sunk.measured, 1e-320),)))


@pytest.mark.parametrize(("column", "value"), [(-3, "50"), (-2, "-1e308")])
def test_a_pressing_that_cannot_be_is_refused(tmp_path, column, value):
    copied = Path(shutil.copytree(DATA / CMU, tmp_path / "set"))
    lines = (copied / "penetration.csv").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if ",wheel_smooth," in line)
    cells = lines[at + 300].split(",")
    cells[column] = value
    lines[at + 300] = ",".join(cells)
    (copied / "penetration.csv").write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"penetration\.csv: .*trial"):
        read_rig_set(copied)


def of_model(soil, r, load):
    """A noiseless rig of the model itself, or None where the wheel hardly sinks, or nearly to its axle."""
    wheel, rows = Wheel(r=r, b=r), []
    for slip in SLIPS:
        try:
            theta_1 = float(entry_angle(load, slip, wheel, soil))
        except ParameterError:
            return None
        forces = wheel_forces(slip, theta_1, -float(soil.exit_ratio) * theta_1, wheel, soil)
        rows.append(
            [
                float(channel_values)
                for channel_values in (forces.f_t, forces.torque, sinkage(theta_1, wheel), forces.f_n)
            ]
        )
    pull, torque, sunk, carried = np.array(rows).T
    if not np.allclose(carried, load, rtol=0.02) or not 0.003 * r < sunk.max() < 0.7 * r:
        return None
    kinds = zip((DrawbarPull, Torque, Sinkage), (pull, torque, sunk), strict=True)
    return RigSet(
        wheel,
        SLIPS,
        load,
        tuple(kind(channel_values, 0.02 * np.abs(channel_values).max()) for kind, channel_values in kinds),
    )


@pytest.mark.parametrize("name", SOILS)
def test_wheels_of_any_size_on_any_soil_raise_no_alarm(name):
    """Radii from 5 mm to 1 m, loads from 1 N to 100 kN; driving alone, and braking too."""
    sizes = [(r, load) for r in (0.005, 0.05, 1.0) for load in (1.0, 10.0, 100.0, 1e4, 1e5)]
    rigs = [rig for rig in (of_model(SOILS[name], *size) for size in sizes) if rig is not None]
    assert len(rigs) >= 2
    for rig in rigs:
        for part in (slice(0, None), slice(2, None)):
            refuse_impossible(rig.rows(part))
            assert suspicions(rig.rows(part)) == []


# --- keys ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[noise]", "[noize]", "there is no key 'noize' in a rig set: did you mean 'noise'?"),
        ("\nphi = {", "\nfriction_angle = {", "there is no key 'friction_angle' in [soil]: did you mean 'phi'?"),
        ("\nphi = {", "\nphii = {", "no key 'phii' in [soil]: did you mean 'phi'?"),
        ("b = {", "width = {", "no key 'width' in [wheel]: did you mean 'b'?"),
        ("sinkage = {", "sinkage_m = {", "no key 'sinkage_m' in [noise]: did you mean 'sinkage'?"),
        ('points = "points.csv"', 'point = "points.csv"', "no key 'point' in [files]: did you mean 'points'?"),
        ('unit = "deg"', 'unti = "deg"', "no key 'unti'"),
    ],
)
def test_a_key_that_nothing_reads_is_refused(tmp_path, old, new, message):
    copied = Path(shutil.copytree(DATA / DING, tmp_path / "set"))
    text = (copied / "rig.toml").read_text()
    assert old in text
    (copied / "rig.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(DataError, match=re.escape(message)):
        read_rig_set(copied)


@pytest.mark.parametrize("name", ["sinkage", "sinkage_mm", "drawbar_pull"])
def test_a_channel_without_its_unit_is_refused(tmp_path, name):
    """It would be left out, and what only it shows would pass for absent."""
    copied = Path(shutil.copytree(DATA / CMU, tmp_path / "set"))
    column = "drawbar_pull_N" if name == "drawbar_pull" else "sinkage_m"
    points = (copied / "points.csv").read_text()
    (copied / "points.csv").write_text(points.replace(f",{column},", f",{name},", 1))
    with pytest.raises(DataError, match=f"column '{name}' is not read: .*{column}.* to SI"):
        read_rig_set(copied)


def test_a_slip_angle_pushes_the_wheel_to_its_left():
    """The side force resists a wheel that goes to its right, odd in the angle, and takes thrust."""
    model = RigModel(Wheel(0.0625, 0.06), Soil(c=0.0, k=0.008, k_1=8e4), ASKEW)
    left, straight, right = (model.predict(24.0, 0.3, slip_angle=angle) for angle in (-0.5, 0.0, 0.5))
    assert right.side_force > 1.0
    assert left.side_force == pytest.approx(-right.side_force)
    assert straight.side_force == 0.0
    assert right.drawbar_pull < straight.drawbar_pull
    plain = RigModel(model.wheel, model.soil).predict(24.0, 0.3)
    assert straight.drawbar_pull == pytest.approx(plain.drawbar_pull, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "slip", "sense"), [(Sinkage, 0.3, 1.0), (Torque, 0.3, 1.0), (DrawbarPull, -0.3, -1.0)]
)
def test_a_sign_is_wrong_beyond_three_sds_of_a_run(kind, slip, sense):
    """Two SDs the wrong way are noise about nothing."""
    rows = np.linspace(slip, slip + 0.05, 6)
    for sds, refused in ((2.0, False), (4.0, True)):
        measured = kind(np.full(6, -sense * sds * 1e-2), 1e-2)
        rig = RigSet(Wheel(), rows, np.full(6, 10.0), (measured,))
        try:
            refuse_impossible(rig)
            message = ""
        except DataError as error:
            message = str(error)
        assert ("by -1" in message) is refused


LEVELS, SD = 6, 0.1


def rig_of(pull, levels=LEVELS, slips=None, load=15.0, others=()):
    """Drawbar pulls of `repeats` runs at each level."""
    pull = np.asarray(pull, dtype=float)
    slip = np.repeat(np.linspace(0.0, 0.6, levels) if slips is None else slips, len(pull) // levels)
    return RigSet(Wheel(r=0.05), slip, load, (DrawbarPull(pull, SD), *others))


def scattered(times):
    """Two repeats a level, whose pooled SD is so many times the stated noise."""
    return np.repeat(np.linspace(0, 1, LEVELS), 2) + np.tile([1, -1], LEVELS) * times * SD / np.sqrt(2)


def said(data):
    return " ".join(map(str, findings(RigExperiment((data,)))))


@pytest.mark.parametrize("times", [0.5, 1.0, 1.4, 1.6, 3.0])
def test_the_pooled_sd_of_repeats(times):
    data = rig_of(scattered(times))
    assert repeat_sd(data, data.channels[0]) == pytest.approx(times)
    alone = rig_of(np.linspace(0, 1, LEVELS))
    assert np.isnan(repeat_sd(alone, alone.channels[0]))
    assert "no level is repeated" in said(alone)
    assert "no level is repeated" not in said(data)
    assert ("the SD of repeats" in said(data)) is (times > 1.5)


@pytest.mark.parametrize("off", [3.5, 4.5])
def test_a_run_that_counts_less_in_fits_is_named(off):
    pull = np.repeat(np.linspace(0, 1, LEVELS), 3)
    pull[4] += off * SD
    assert ("from its repeats" in said(rig_of(pull))) is (off > 4.0)


def test_channels_that_were_not_measured_are_named():
    assert "torque was not measured" in said(rig_of(scattered(0.5)))
    assert "sinkage was not measured" in said(rig_of(scattered(0.5)))
    both = rig_of(scattered(0.5), others=(Torque(scattered(0.5), SD), Sinkage(0.01 + 0 * scattered(1.0), 1e-3)))
    assert "was not measured" not in said(both)
    assert "no speeds" in said(both)
    assert "no speeds" not in said(dataclasses.replace(both, speeds=np.ones((2 * LEVELS, 2))))


def experiment_of(*arguments, **named):
    return RigExperiment((rig_of(*arguments, **named),))


def test_what_is_too_poor():
    enough = rig_of(scattered(0.5))
    assert too_poor(RigExperiment((enough,)), 9) == ""
    assert "10 uncertain soil constants" in too_poor(RigExperiment((enough,)), 10)
    assert too_poor(experiment_of(scattered(0.5), slips=np.linspace(0.1, 0.26, LEVELS)), 2) == ""
    assert "slips span only 0.14" in too_poor(experiment_of(scattered(0.5), slips=np.linspace(0.1, 0.24, LEVELS)), 2)
    assert too_poor(experiment_of(scattered(0.5), levels=3), 2) == ""
    assert "2 levels of slip" in too_poor(experiment_of(scattered(0.5), levels=2), 2)
