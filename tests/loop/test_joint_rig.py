"""Several rig sets in one sand: one soil and one answer, wheels and rig errors of their own, each set's errors told."""

import dataclasses
import json

import numpy as np
import pytest

from rover_pin import Wheel, close_the_loop
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.experiments.wheel_rig.candidates import candidates, rig_kinds
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, join_sets, read_joint
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.experiments.wheel_rig.model import RigModel, read_model
from rover_pin.loop.close import verdict_on
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated
from tests.oracle import rig_generator as hidden

SLIPS = (0.0, 0.15, 0.3, 0.5, 0.75)
TARE = 1.5


def written(folder, name, effect="none", r=0.0625, b=0.06, seed=0, toml="", tare=0.0, loads=(15.0, 40.0)):
    """A set of a wheel of these sizes, by a generator that shares no code, in the one sand."""
    rig = hidden.Rig(effect)
    rig.r, rig.b = r, b
    table = hidden.rig_set(rig, loads=loads, slips=SLIPS, repeats=1, seed=seed)
    table["drawbar_pull_N"] = table["drawbar_pull_N"] + tare
    path = hidden.write(folder / name, rig, table)
    text = (path / "rig.toml").read_text().replace('name = "hidden"', f'name = "{name}"')
    (path / "rig.toml").write_text(text.replace("[wheel]\n", f"[wheel]\n{toml}"))
    return path


@pytest.fixture(scope="module")
def sets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("joint")
    small = written(folder, "small", seed=1)
    large = written(folder, "large", r=0.125, b=0.10, seed=2, tare=TARE, loads=(60.0,))
    text = (large / "rig.toml").read_text()
    (large / "rig.toml").write_text(text + '\n[rig]\npull_tare = { value = 0.0, sd = 3.0, unit = "N" }\n')
    return small, large


@pytest.fixture(scope="module")
def lugged(tmp_path_factory):
    """A wheel of low lugs, one of high ones and a smooth one."""
    surfaces = ("low", "lug_height = 0.003"), ("high", "lug_height = 0.006"), ("smooth", 'surface = "smooth"')
    folder = tmp_path_factory.mktemp("lugged")
    return [written(folder, name, toml=f"{toml}\n", seed=3 + at) for at, (name, toml) in enumerate(surfaces)]


def fitted(joint):
    model = joint.base_model()
    return calibrated(joint, model, joint.uncertain(model))


def test_one_soil_under_two_wheels_and_an_error_of_one_rig_alone(sets):
    """K of the sand holds at both widths, so k_2 is 0; the tare is the large wheel's, and of its size."""
    joint = read_joint(sets)
    joint_fit = fitted(joint)
    names = [parameter.name for parameter in joint_fit.parameters]
    assert "large.rig.pull_tare" in names
    assert not [name for name in names if name.startswith("small.")]
    assert {"soil.k", "soil.phi", "soil.k_1", "soil.k_2", "soil.n", "soil.c"} <= set(names)
    true = hidden.Rig("none").soil
    assert joint_fit.value("soil.phi") == pytest.approx(true["phi"], abs=0.03)
    assert joint_fit.value("soil.k") == pytest.approx(true["k"], rel=0.15)
    at = [joint_fit.value("soil.k_1") + joint_fit.value("soil.k_2") * b for b in (0.06, 0.10)]
    assert at == pytest.approx([true["K"]] * 2, rel=0.15)
    assert joint_fit.value("large.rig.pull_tare") == pytest.approx(TARE, abs=0.6)
    assert joint_fit.misfit < 1.3


def test_a_set_cut_in_two_is_fitted_as_the_whole(sets):
    rig = read_rig_set(sets[0])
    low = rig.level < 2
    parts = [dataclasses.replace(part, name=name) for name, part in (("low", rig.rows(low)), ("high", rig.rows(~low)))]
    experiment = RigExperiment((rig,))
    model = RigModel(rig.wheel, rig.soil(), errors=rig.errors)
    alone = calibrated(experiment, model, experiment.uncertain(model))
    together = fitted(join_sets(parts))
    assert [parameter.name for parameter in together.parameters] == [parameter.name for parameter in alone.parameters]
    assert together.u == pytest.approx(alone.u, abs=1e-3)
    assert together.misfit == pytest.approx(alone.misfit, rel=1e-5)


def test_slopes_are_prediction_differences_for_any_lug_height(sets, lugged):
    joint = read_joint([*sets, *lugged])
    base = joint.base_model()
    lugs = next(candidate for candidate in candidates(joint, base, rig_kinds()) if candidate.kind == "LugExcavation")
    assert lugs.effect.h_l == 0.006
    model = lugs.on(base)
    heights = {
        name: [effect.h_l for effect in model.of(name).effects if isinstance(effect, LugExcavation)]
        for name in joint.runs
    }
    assert heights == {"small": [0.006], "large": [0.006], "low": [0.003], "high": [0.006], "smooth": []}
    numbers = (*joint.uncertain(base), *lugs.cause.parameters)
    u = np.full(len(numbers), 0.1)
    slopes = joint.sensitivities(model, numbers, u).slopes
    for at, number in enumerate(numbers):
        step = 1e-5 * np.eye(len(u))[at]
        up, down = (joint.sensitivities(model, numbers, u + shift).predicted for shift in (step, -step))
        np.testing.assert_allclose(slopes[at], (up - down) / 2e-5, atol=1e-7 + 1e-5 * np.nanmax(np.abs(slopes[at])),
                                   err_msg=number.name)  # fmt: skip
    named = joint.with_values(model, {number.name: number.value(0.1) for number in numbers})
    np.testing.assert_allclose(
        joint.predict([named])[0], np.nan_to_num(joint.sensitivities(model, numbers, u).predicted)
    )


def test_lugs_dig_from_the_start_where_every_set_declares_them(sets, lugged):
    """One height for both, the lower wheel's in proportion; slopes of it are differences of predictions."""
    joint = read_joint(lugged)
    base = joint.base_model()
    heights = {
        name: [effect.h_l for effect in base.of(name).effects if isinstance(effect, LugExcavation)]
        for name in joint.runs
    }
    assert heights == {"low": [0.003], "high": [0.006], "smooth": []}
    numbers = joint.uncertain(base)
    (at,) = [at for at, number in enumerate(numbers) if "h_l" in number.name]
    assert (numbers[at].name, numbers[at].origin, numbers[at].scale) == ("LugExcavation.h_l", 0.006, 0.3 * 0.006)
    assert "LugExcavation" not in {candidate.kind for candidate in candidates(joint, base, rig_kinds())}
    u = np.full(len(numbers), 0.1)
    slopes = joint.sensitivities(base, numbers, u).slopes[at]
    step = 1e-5 * np.eye(len(u))[at]
    up, down = (joint.sensitivities(base, numbers, u + shift).predicted for shift in (step, -step))
    np.testing.assert_allclose(slopes, (up - down) / 2e-5, atol=1e-7 + 1e-5 * np.nanmax(np.abs(slopes)))
    assert np.nanmax(np.abs(slopes)) > 0
    untold = read_joint([sets[0], lugged[1]]).base_model()
    assert "LugExcavation" not in {type(effect).__name__ for effect in untold.effects}


def test_what_is_no_joint_fit_is_refused(sets, tmp_path):
    with pytest.raises(ParameterError, match="two or more"):
        join_sets([read_rig_set(sets[0])])
    twin = written(tmp_path, "small", seed=9)
    with pytest.raises(DataError, match="small: "):
        read_joint((sets[0], twin))
    with pytest.raises(DataError, match=r"nowhere: .*rig\.toml"):
        close_the_loop((sets[0], tmp_path / "nowhere"))
    with pytest.raises(DataError, match="joint fit"):
        close_the_loop(sets, model="model.toml")


@pytest.fixture(scope="module")
def softened(tmp_path_factory):
    """Two wheels in sand that slip softens: the loop on both, with two effects to choose from."""
    folder = tmp_path_factory.mktemp("softened")
    sizes = (("small", 0.0625, 0.06, (25.0,)), ("large", 0.125, 0.06, (60.0,)))
    sets = [written(folder, name, "slip_softening", r, b, 3, "", 0.0, loads) for name, r, b, loads in sizes]
    joint = read_joint(sets)
    return joint, verdict_on(RigData(joint), (SlipSoftening, Bulldozing))


@pytest.mark.slow
def test_common_missing_effect_is_named_with_errors_of_each_set(softened):
    joint, verdict = softened
    assert verdict.named == ("SlipSoftening",)
    rows = {(set_row.set, set_row.channel): set_row for set_row in verdict.extra.sets}
    assert set(rows) == {(name, channel) for name in joint.runs for channel in joint.channels}
    for name in joint.runs:
        set_row = rows[name, "sinkage"]
        assert set_row.after < 0.5 * set_row.before
        levels = [level.after for level in next(s for s in verdict.scores if s.name == "sinkage").levels]
        errors_of_set = [error for error, fold in zip(levels, joint.folds, strict=True) if fold.startswith(f"{name}: ")]
        assert set_row.after == pytest.approx(np.sqrt(np.mean(np.square(errors_of_set)))), "as many runs at each level"
        assert f"{name}: held-out sinkage" in verdict.summary()
    lost = [set_row for set_row in verdict.extra.sets if set_row.curve_error < set_row.after]
    assert sum("of that set alone" in caution for caution in verdict.cautions) == len(lost)


@pytest.mark.slow
def test_loop_on_two_sets_writes_a_report_and_a_model_of_each(sets, tmp_path):
    verdict = close_the_loop(sets, out=tmp_path)
    assert verdict.answer.value == "no effect needed"
    page = (tmp_path / "report.html").read_text()
    assert "Errors of each set" in page
    assert "small: sinkage" in page
    assert {row.name for row in verdict.files} >= {
        "model-small.toml",
        "model-large.toml",
        "report.html",
        "verdict.json",
    }
    assert read_model(tmp_path / "model-large.toml").wheel == Wheel(0.125, 0.10)
    report = json.loads((tmp_path / "verdict.json").read_text())
    assert [row["set"] for row in report["extra"]["sets"]] == ["small"] * 3 + ["large"] * 3
    assert report["command"].startswith("rover-pin close-loop ")


def test_a_run_that_stands_in_two_sets_is_used_once(sets, tmp_path):
    small = read_rig_set(sets[0])
    copy_of_small = dataclasses.replace(small, name="again")
    more = written(tmp_path, "more", seed=7)
    rows = (more / "points.csv").read_text().splitlines() + (sets[0] / "points.csv").read_text().splitlines()[1:4]
    (more / "points.csv").write_text("\n".join(rows) + "\n")
    joint = read_joint((sets[0], more))
    (finding,) = map(str, joint.twice)
    assert finding.startswith("more: 3 of 13 runs ")
    assert int(np.isfinite(joint.observed[:, 0]).sum()) == 20
    with pytest.raises(DataError, match="again: every run"):
        join_sets([small, copy_of_small])
