"""A wheel pressed in is data of the same fit, by the same soil; what its sand has otherwise bends nothing."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Soil, Wheel, close_the_loop
from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.wheel_rig.candidates import default_effect, rig_kinds
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, join_sets
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel
from rover_pin.experiments.wheel_rig.runs import PRESSED, pressed_in
from rover_pin.loop.identify import identify
from rover_pin.measurements.pressed import Trial
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.soil.wheel_forces import pressing_force
from studies.shared.rig_fits import calibrated
from tests.oracle import rig_generator as hidden

DATA = Path(__file__).parents[3] / "studies" / "data"
DEPTHS = np.linspace(0.001, 0.03, 60)


def pressed_set(folder, rig, stiffer=1.0, loads=(25.0,), undeclared=("n",)):
    """A set and three pressings of its wheel, whose sand is so many times as stiff, 3 % by chance besides."""
    path = hidden.write(folder, rig, hidden.rig_set(rig, loads=loads))
    random, rows = np.random.default_rng(7), ["trial,indenter,sinkage_m,force_N"]
    for trial in range(3):
        bed = stiffer * np.exp(0.03 * random.normal())
        rows += [f"{trial},wheel,{h:.6g},{bed * np.exp(0.02 * random.normal()) * rig.press(h):.6g}" for h in DEPTHS]
    (path / "penetration.csv").write_text("\n".join(rows) + "\n")
    lines = (path / "rig.toml").read_text().replace('"points.csv" }', '"points.csv", penetration = "penetration.csv" }')
    stored = [line for line in lines.splitlines() if not line.startswith(tuple(f"{name} =" for name in undeclared))]
    (path / "rig.toml").write_text("\n".join(stored) + "\n")
    return path


def forces(rig, effects=(), scale=1.0):
    soil = Soil(k_1=rig.soil["K"], k_2=0.0, n=rig.soil["n"], c=rig.soil["c"], phi=rig.soil["phi"])
    model = RigModel(as_wheel(rig), soil, (*PAPER, *effects))
    model = dataclasses.replace(model, errors=model.errors.replace(pressing_scale=scale))
    trials = (Trial("only", DEPTHS[5:], np.ones(len(DEPTHS) - 5)),)
    return np.exp(pressed_in(model, (), model.vector(), trials)[0].ravel())


def as_wheel(rig):
    return Wheel(r=rig.r, b=rig.b)


@pytest.mark.parametrize(
    ("boxes", "names"), [((), ["0", "1", "2"]), (("f-d", "loose"), ["f-d, 1", "f-d, 0", "f-d, 2"])]
)
def test_a_pressing_is_named_in_words(tmp_path, boxes, names):
    """Its fold was called `pressed in: ('f-d', 1)`, a tuple of Python, in every report."""
    path = pressed_set(tmp_path, hidden.Rig("none"))
    if boxes:
        lines = (path / "penetration.csv").read_text().splitlines()
        rows = [f"{boxes[0]},{line}" for line in lines[1:]]
        (path / "penetration.csv").write_text("\n".join([f"box,{lines[0]}", *rows]) + "\n")
    trials = read_rig_set(path).trials
    assert sorted(trial.name for trial in trials) == sorted(names)


def test_it_predicts_what_plain_sums_press():
    """Midpoint sums, no shared code; an exponent that changes with depth changes the pressing too."""
    rig = hidden.Rig("none")
    assert forces(rig, scale=1.3) == pytest.approx([1.3 * rig.press(h) for h in DEPTHS[5:]], rel=1e-3)
    deep = hidden.Rig("load_exponent", 0.5)
    (kind,) = [kind for kind in rig_kinds() if kind.__name__ == "LoadExponent"]
    assert forces(deep, (kind(n_h=0.5),)) == pytest.approx([deep.press(h) for h in DEPTHS[5:]], rel=1e-3)


def test_lugs_press_with_full_pockets():
    """Measured wheels: the smooth one's sand carries the lugged one from its lugs' tips down, within its own scatter.

    The mean of tips and bare rim by their shares (Jia, Smith and Peng, Robotica 30 (2012) 491) is half as strong.
    """
    smooth, lugged = (read_rig_set(DATA / f"cmu-{name}-wheel") for name in ("smooth", "grousered"))
    wheel, soil = smooth.wheel, smooth.soil()
    off, of_mean = [], []
    for trial in lugged.trials:
        tips = np.array([float(pressing_force(h, wheel, soil)) for h in trial.sinkage])
        inner = wheel.replace(r=wheel.r - 0.005)
        rim = np.array([float(pressing_force(max(h - 0.005, 1e-5), inner, soil)) for h in trial.sinkage])
        off.append(np.log(trial.force / tips).mean())
        of_mean.append(np.log(trial.force / (0.1 * tips + 0.9 * rim)).mean())
    assert len(off) == 4
    assert np.abs(off).max() < 0.3
    assert np.mean(off) == pytest.approx(0.0, abs=0.15)
    assert np.min(of_mean) > 0.4


@pytest.mark.parametrize("kind", rig_kinds(), ids=lambda kind: kind.__name__)
def test_every_effect_is_defined_where_nothing_turns(kind):
    rig = hidden.Rig("none")
    model = RigModel(as_wheel(rig), Soil()).having(default_effect(kind, RigModel(as_wheel(rig), Soil())))
    trials = (Trial("only", DEPTHS[5:], np.ones(len(DEPTHS) - 5)),)
    values, slopes = pressed_in(model, model.names, model.vector(), trials)
    assert np.isfinite(values).all()
    assert np.isfinite(slopes).all()


def test_slopes_are_those_of_differences(tmp_path):
    experiment = RigExperiment((read_rig_set(pressed_set(tmp_path / "set", hidden.Rig("none"))),))
    model = experiment.base_model()
    numbers = experiment.uncertain(model)
    assert {"soil.n", "rig.pressing_scale"} < {number.name for number in numbers}
    u, step = np.zeros(len(numbers)), 1e-5
    slopes = experiment.sensitivities(model, numbers, u).slopes
    assert experiment.channels[-1] == PRESSED
    assert np.isfinite(experiment.observed[-3:, -1]).all()
    for at in range(len(numbers)):
        up, down = (
            experiment.sensitivities(model, numbers, u + sign * step * np.eye(len(u))[at]) for sign in (1.0, -1.0)
        )
        assert slopes[at] == pytest.approx(
            (up.predicted - down.predicted) / (2 * step), rel=2e-4, abs=1e-7, nan_ok=True
        )


def test_pressings_tell_the_exponent_that_one_load_does_not(tmp_path):
    rig = hidden.Rig("none", n=1.3)
    result = identify(pressed_set(tmp_path / "set", rig))
    assert result["n"].is_found
    assert result["n"].number.low < 1.3 < result["n"].number.high
    assert result["n"].number.high - result["n"].number.low < 0.25
    bare = hidden.write(tmp_path / "bare", rig, hidden.rig_set(rig, loads=(25.0,)))
    assert "soil.n" in identify(bare).held


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", [*(pytest.param(x, marks=pytest.mark.nightly) for x in (0.7, 1.0)), 1.5])
def test_sand_stiffer_when_pressed_is_said_and_not_bent(tmp_path, stiffer):
    """The soil under the rolling wheel stays what it is, and nothing is missing."""
    rig = hidden.Rig("none")
    verdict = close_the_loop(pressed_set(tmp_path / "set", rig, stiffer, loads=(15.0, 40.0)))
    numbers = {number.name: number for number in verdict.before.numbers}
    assert verdict.answer is Answer.NONE_NEEDED
    for name, true in (("rig.pressing_scale", stiffer), ("soil.k_1", rig.soil["K"]), ("soil.n", rig.soil["n"])):
        assert numbers[name].low < true < numbers[name].high, numbers[name].text


def test_a_pressed_set_stands_beside_one_that_is_not(tmp_path):
    rig = hidden.Rig("none")
    pressed = read_rig_set(pressed_set(tmp_path / "set", rig))
    second = read_rig_set(hidden.write(tmp_path / "other", rig, hidden.rig_set(rig, loads=(40.0,), seed=4)))
    second = dataclasses.replace(second, name="other")
    joint = join_sets([pressed, second])
    assert joint.channels[-1] == PRESSED
    assert len(joint.folds) == len(joint.campaigns) == 2 * len(hidden.SLIPS) + 3
    names = [number.name for number in joint.uncertain(joint.base_model())]
    assert names.count("soil.n") == 1
    assert [name for name in names if name.endswith("pressing_scale")] == [f"{pressed.name}.rig.pressing_scale"]
    predicted = joint.predict([joint.base_model()])[0]
    assert np.isfinite(predicted[np.isfinite(joint.observed)]).all()


K_1, K_2, N = 3e4, 1.5e6, 1.2
"""Constants of Reece's pressure (k_1 + k_2 b) (h / b)^n [Pa, Pa/m, -] that the plates below are pressed against."""


def with_plates(folder, stiffer=1.0, diameters=(0.05, 0.1), sides=((0.06, 0.15),)):
    """A set whose sand was also measured by a bevameter, with round plates (b is the radius) and rectangular ones."""
    rig = hidden.Rig("none")
    path = hidden.write(folder, rig, hidden.rig_set(rig, loads=(25.0,)))
    random = np.random.default_rng(11)
    rows = ["trial,indenter,plate_diameter_m,plate_width_m,plate_length_m,sinkage_m,force_N"]
    plates = [(d / 2, np.pi * d**2 / 4, f"{d},,") for d in diameters] + [(b, b * a, f",{a},{b}") for b, a in sides]
    for trial, (b, area, cells) in enumerate(plates):
        force = stiffer * area * (K_1 + K_2 * b) * (DEPTHS / b) ** N * np.exp(0.02 * random.normal(size=DEPTHS.size))
        rows += [f"{trial},plate,{cells},{h:.6g},{f:.6g}" for h, f in zip(DEPTHS, force, strict=True)]
    (path / "penetration.csv").write_text("\n".join(rows) + "\n")
    lines = (path / "rig.toml").read_text().replace('"points.csv" }', '"points.csv", penetration = "penetration.csv" }')
    stored = [line for line in lines.splitlines() if not line.startswith("n =")]
    (path / "rig.toml").write_text("\n".join(stored) + "\n")
    return path


def test_plates_of_a_bevameter_are_pressed_by_their_own_size(tmp_path):
    rig = read_rig_set(with_plates(tmp_path / "set"))
    sizes = np.array(sorted(trial.plate for trial in rig.trials))
    assert sizes == pytest.approx(np.array([(0.025, np.pi * 0.025**2), (0.05, np.pi * 0.05**2), (0.06, 0.009)]))
    soil = Soil(k_1=K_1, k_2=K_2, n=N, c=0.0)
    model = RigModel(Wheel(0.1, 0.08), soil)
    model = dataclasses.replace(model, errors=model.errors.replace(plate_scale=1.3))
    values, slopes = pressed_in(model, ("k_1", "k_2", "n", "rig.plate_scale"), model.vector(), rig.trials)
    for trial, logs in zip(rig.trials, values[:, 0], strict=True):
        assert np.exp(logs) == pytest.approx(1.3 * trial.force, rel=0.07)
    assert slopes[3] == pytest.approx(1 / 1.3)


def test_plates_of_several_widths_measure_the_sand_of_the_wheel(tmp_path):
    """The exponent and the growth of the modulus with the width follow from plates; its level also from the wheel."""
    fits = {}
    for stiffer in (1.0, 1.4):
        experiment = RigExperiment((read_rig_set(with_plates(tmp_path / str(stiffer), stiffer)),))
        model = experiment.base_model()
        numbers = experiment.uncertain(model)
        assert {"soil.n", "soil.k_2", "rig.plate_scale"} < {number.name for number in numbers}
        assert "rig.pressing_scale" not in {number.name for number in numbers}
        fits[stiffer] = calibrated(experiment, model, numbers)
    fit = fits[1.0]
    ratio = [(fit.value("soil.k_1") + fit.value("soil.k_2") * b) / b ** fit.value("soil.n") for b in (0.025, 0.06)]
    assert ratio[0] / ratio[1] == pytest.approx(
        (K_1 + K_2 * 0.025) / (K_1 + K_2 * 0.06) * (0.06 / 0.025) ** N, rel=0.15
    )
    assert fit.value("soil.n") == pytest.approx(N, abs=0.15)
    # A bed that is stiffer for the plates alone moves their scale, not the sand of the wheel.
    stiffer = fits[1.4].value("rig.plate_scale") / fit.value("rig.plate_scale")
    assert stiffer == pytest.approx(1.4, rel=0.1)
    assert fits[1.4].value("soil.phi") == pytest.approx(fit.value("soil.phi"), abs=0.01)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [(",0.05,,,", ",50.0,,,", "plate_diameter_m"), (",0.15,0.06,", ",0.15,,", "plate_width_m")],
)
def test_a_plate_without_its_size_is_refused(tmp_path, old, new, message):
    broken = with_plates(tmp_path / "set")
    table = (broken / "penetration.csv").read_text()
    assert old in table
    (broken / "penetration.csv").write_text(table.replace(old, new))
    with pytest.raises(DataError, match=message):
        read_rig_set(broken)
