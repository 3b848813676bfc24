"""The loop on wheel-rig sets: hidden effects named, null sets left alone, what is not on the list described."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Soil, Wheel, close_the_loop
from rover_pin.base.errors import DataError
from rover_pin.discrepancy import draft as draft_module
from rover_pin.discrepancy.answer import Answer
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.experiments.wheel_rig.candidates import default_effect, effect_kinds, rig_kinds
from rover_pin.experiments.wheel_rig.model import RigModel, conditions, predictor, read_model, write_model
from rover_pin.measurements.rig_reading import read_rig_set
from tests.oracle import rig_generator as hidden

DATA = Path(__file__).parents[3] / "studies" / "data"


def folder(tmp_path, effect, seed=0, nominal=None, **columns):
    rig = hidden.Rig(effect)
    table = hidden.rig_set(rig, **({"loads": (15.0, 40.0), "seed": seed} | columns))
    return hidden.write(tmp_path / effect, rig, table, nominal)


# --- the rig model ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", ["none", *hidden.IS])
def test_it_predicts_what_the_plain_generator_measures(effect):
    """Another quadrature (midpoint, 2000 points) and another root finder (bisection), no shared code."""
    rig = hidden.Rig(effect)
    s = rig.soil
    soil = Soil(s["c"], s["phi"], s["k"], s["K"], 0.0, s["n"], exit_ratio=s["exit_ratio"])
    model = RigModel(Wheel(rig.r, rig.b), soil)
    if effect != "none":
        kind = next(kind for kind in effect_kinds() if kind.__name__ == hidden.IS[effect])
        effect_tried = default_effect(kind, model)
        model = model.having(effect_tried.replace(**{next(iter(effect_tried.neutral)): rig.size}))
    slip = np.array([-0.2, 0.0, 0.2, 0.6])
    rows = np.array([rig.run(25.0, S) for S in slip])
    prediction = model.predict(25.0, slip, np.column_stack([np.full(4, 0.02), rows[:, 3]]))
    np.testing.assert_allclose(prediction.drawbar_pull, rows[:, 0], atol=2e-3)
    np.testing.assert_allclose(prediction.torque, rows[:, 1], atol=2e-4)
    np.testing.assert_allclose(prediction.sinkage, rows[:, 2], rtol=1e-4)


@pytest.mark.parametrize("kind", rig_kinds(), ids=lambda kind: kind.__name__)
def test_every_effect_works_on_a_rig_with_an_exact_jacobian(kind):
    base = RigModel(Wheel(0.0625, 0.06), Soil(c=200.0, phi=0.5, k=0.008, k_1=9e4, n=1.1))
    model = base.having(default_effect(kind, base))
    free = tuple(name for name in model.names if "." in name or name in ("phi", "k_1", "n"))
    runs = conditions(np.array([20.0, 30.0]), np.array([0.15, 0.6]))
    predict, at = predictor(model, free, runs), model.vector()
    values, jacobian, error = predict(at)
    assert np.isfinite(values).all()
    assert np.abs(error).max() < 1e-6
    for column, name in enumerate(free):
        index = model.names.index(name)
        step = np.zeros(at.size)
        step[index] = 1e-5 * (abs(at[index]) or 1.0)
        slope = (predict(at + step).values - predict(at - step).values) / (2 * step[index])
        scale = np.abs(values) / (abs(at[index]) or 1.0)
        np.testing.assert_allclose(jacobian[:, :, column], slope, atol=1e-4 * scale.max(), rtol=1e-3, err_msg=name)


def test_a_model_file_gives_the_same_numbers_back(tmp_path):
    base = RigModel(Wheel(), Soil(phi=0.4))
    for kind in effect_kinds():
        model = base.having(default_effect(kind, base))
        assert read_model(write_model(model, tmp_path / "model.toml")) == model
    text = (tmp_path / "model.toml").read_text()
    (tmp_path / "model.toml").write_text(text.replace("rig-model", "drive"))
    with pytest.raises(DataError, match="kind = 'drive'"):
        read_model(tmp_path / "model.toml")
    (tmp_path / "model.toml").write_text(text.replace("SoilTraction", "SoilTracton"))
    with pytest.raises(DataError, match=r"'SoilTracton'.*'SoilTraction'"):
        read_model(tmp_path / "model.toml")
    (tmp_path / "model.toml").write_text(text.replace("SinkageAngles", "Angles"))
    with pytest.raises(DataError, match="'Angles'"):
        read_model(tmp_path / "model.toml")


# --- hidden effects --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_hidden_effect_is_named_with_its_size_and_reported(tmp_path):
    messages = []
    path = folder(tmp_path, "slip_sinkage", nominal=hidden.WRONG)
    verdict = close_the_loop(path, out=tmp_path / "out", progress=messages.append)
    assert verdict.answer is Answer.NAMED
    assert [type(effect) for effect in verdict.effects] == [SlipSinkage]
    number = next(entry for entry in verdict.after.numbers if entry.name == "SlipSinkage.n_1")
    assert number.low <= 0.6 <= number.high
    assert verdict.effects[0].n_1 == number.value
    for score in verdict.scores:
        assert score.after < 1.3 * score.floor
    assert next(score for score in verdict.scores if score.name == "sinkage").claim == "better"
    document = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert document["effects"] == ["SlipSinkage"]
    assert document["schema"] == 3
    assert document["posterior"]["tried"] == verdict.tried > 15
    assert document["posterior"]["inclusion"]["SlipSinkage"] > 0.95
    assert document["posterior"]["sets"][0]["causes"] == ["SlipSinkage"]
    assert sum(entry["probability"] for entry in document["posterior"]["sets"]) == pytest.approx(1.0, abs=0.05)
    assert document["command"].startswith("rover-pin close-loop")
    page = (tmp_path / "out" / "report.html").read_text()
    title, _, first_screen = page.partition("<h1>")[2].partition("</h1>")
    assert "slip-sinkage" in title
    assert "n_1 = " in first_screen.partition("<svg")[0]
    assert page.count('<svg role="img"') == sum(file.suffix == ".png" for file in verdict.files)
    assert "No channel got worse" in page
    assert verdict.chosen_again == "SlipSinkage chosen in 7 of 7 folds"
    assert set(document["folds"].values()) == {"SlipSinkage"}
    sunk = next(entry for entry in document["held_out"] if entry["name"] == "sinkage")
    assert [entry["level"] for entry in sunk["levels"]] == list(document["folds"])
    assert np.mean([entry["after"] ** 2 for entry in sunk["levels"]]) == pytest.approx(sunk["after"] ** 2)
    profile = next(entry for entry in document["profiles"] if entry["name"] == "SlipSinkage.n_1")
    assert min(profile["rises"]) == 0 < 3.84 < max(profile["rises"])
    before, after = (document["extra"][side]["residual_tests"] for side in ("before", "after"))
    against_slip = [entry["p"] for entry in before if (entry["channel"], entry["against"]) == ("sinkage", "slip")]
    assert against_slip[0] < 0.01
    assert min(entry["p"] for entry in after) > 1e-3
    assert "http" not in page.replace("http://www.w3.org", "")  # but for the names of SVG's elements
    assert read_model(tmp_path / "out" / "model.toml") == verdict.model
    assert "an effect is missing" in verdict.summary()
    assert messages[0] == "calibrating the base model"


@pytest.mark.slow
def test_a_null_set_needs_no_effect(tmp_path):
    verdict = close_the_loop(folder(tmp_path, "none", seed=3, nominal=hidden.WRONG))
    assert verdict.answer is Answer.NONE_NEEDED
    assert verdict.effects == verdict.named == ()
    assert verdict.beliefs.sets[frozenset()] > 0.5
    assert all(residual.is_noise for residual in verdict.extra.after.residuals)


@pytest.mark.slow
def test_unlisted_effect_is_described_and_its_draft_is_an_effect(tmp_path):
    path = folder(tmp_path, "slip_squared_drag")
    verdict = close_the_loop(path, out=tmp_path / "out")
    assert verdict.answer is Answer.NONE_FITS
    assert verdict.effects == ()
    assert verdict.beliefs.leaves_more(()) > 0.5
    assert max(verdict.beliefs.included.values()) < 0.5
    assert any(
        not residual.is_noise and "smooth fit" in residual.sentence for residual in verdict.extra.after.residuals
    )
    draft = verdict.draft
    assert draft.accepted
    assert all(score.after < 1.3 * score.floor for score in draft.scores)
    assert [score.before for score in draft.scores] == [score.before for score in verdict.scores]
    assert max(score.before / score.after for score in draft.scores) > 2
    assert f"--effects {tmp_path / 'out' / 'draft_effect' / 'measured_remainder.py'}" in verdict.summary()
    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["draft"]["accepted"] is True
    again = close_the_loop(path, effects=tmp_path / "out" / "draft_effect")
    assert again.indistinguishable[0] == "MeasuredRemainder"
    assert again.share > 0.95


@pytest.mark.slow
def test_a_fold_nobody_predicts_vetoes_a_draft_on_a_rig(tmp_path, monkeypatch):
    levels = []

    def all_but_the_first(fitted):
        levels.append(fitted.task.experiment.folds)
        return np.array([np.nan, *(0.0 for _ in levels[-1][1:])])

    monkeypatch.setattr(draft_module, "losses_of", all_but_the_first)
    draft = close_the_loop(folder(tmp_path, "slip_squared_drag")).draft
    assert draft.log_odds > 0
    assert not draft.accepted
    assert draft.unpredicted == levels[-1][:1]


@pytest.mark.slow
def test_noise_that_is_larger_than_declared_is_no_unknown_effect(tmp_path):
    """Seven of seven blind sets with nothing hidden were once called "none of these"."""
    rig = hidden.Rig("none")
    path = hidden.write(tmp_path, rig, hidden.rig_set(rig, seed=5, mixed=True, noise="understated"))
    verdict = close_the_loop(path)
    assert verdict.answer is Answer.NONE_NEEDED
    assert verdict.draft is None
    shares = np.array(list(verdict.beliefs.best(()).noise_taken.values()))
    assert (shares > 1.0).all()
    assert shares.mean() == pytest.approx(1.4, rel=0.2), "the prior of the scale draws it to what is declared"
    assert verdict.before.misfit > 1.5, "chi2 is told in the declared noise"


# --- data that cannot answer -----------------------------------------------------------------------------------------


def changed(tmp_path, change):
    path = folder(tmp_path, "none", loads=(25.0,), repeats=1)
    lines = (path / "points.csv").read_text().splitlines()
    names = lines[0].split(",")
    table = dict(zip(names, np.array([line.split(",") for line in lines[1:]], dtype=float).T, strict=True))
    change(table)
    rows = zip(*table.values(), strict=True)
    text = [",".join(table), *(",".join(map(str, row)) for row in rows)]
    (path / "points.csv").write_text("\n".join(text) + "\n")
    return path


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda table: table.update(rim_speed_mps=2.0 * table["rim_speed_mps"]), "its speeds give .* by Eq"),
        (
            lambda table: table.update(slip=0.2 + 0 * table["slip"], rim_speed_mps=0.025 + 0 * table["slip"]),
            "slip is 0.2 in every run",
        ),
        (lambda table: table.update(level=0 * table["level"]), r"all runs are of one level of slip \(0.0\)"),
        (lambda table: table.update(torque_Nm=0.4 + 0 * table["slip"]), "torque_Nm is 0.4 in all 7 runs"),
    ],
)
def test_data_that_cannot_be_used_get_one_sentence(tmp_path, change, message):
    with pytest.raises(DataError, match=message):
        close_the_loop(changed(tmp_path, change))


def test_a_set_too_poor_says_so(tmp_path):
    data = read_rig_set(folder(tmp_path, "slip_sinkage", loads=(25.0,))).rows(slice(0, 4))
    verdict = close_the_loop(data)
    assert (verdict.answer, verdict.effects) == (Answer.CANNOT_TELL, ())
    assert "2 levels of slip" in verdict.sentence


def test_pressing_files_of_several_wheels_need_the_surface(tmp_path):
    path = shutil.copytree(DATA / "cmu-smooth-wheel", tmp_path / "set")
    lugged = (DATA / "cmu-grousered-wheel" / "penetration.csv").read_text().partition("\n")[2]
    (path / "penetration.csv").write_text((path / "penetration.csv").read_text() + lugged)
    assert len(read_rig_set(path).trials) == 3
    text = (path / "rig.toml").read_text()
    (path / "rig.toml").write_text(text.replace('surface = "smooth"', 'surface = "rubber"'))
    with pytest.raises(DataError, match=r"several wheels were pressed in \(wheel_.*surface"):
        read_rig_set(path)


# --- measured data ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_smooth_wheel_sinks_with_slip():
    """Held-out sinkage error 5.6 -> 1.2 mm, by either form, in all folds but one; then sand is as stiff as pressed in.

    Without S = 0 firm ground under a hole fits best; some folds add a second effect.
    """
    verdict = close_the_loop(DATA / "cmu-smooth-wheel")
    laws = [{"SlipSinkage", "SlipSoftening"} & set(chosen.split(" + ")) for chosen in verdict.chosen.values()]
    assert sum(map(bool, laws)) >= len(laws) - 1, verdict.chosen
    assert verdict.named[0] in ("SlipSoftening", "SlipSinkage")
    included = verdict.beliefs.included
    assert included.get("SlipSoftening", 0.0) + included.get("SlipSinkage", 0.0) > 0.9
    pull, sunk, _ = verdict.scores
    assert sunk.before == pytest.approx(5.5e-3, abs=0.4e-3)
    assert sunk.after == pytest.approx(1.1e-3, abs=0.15e-3)
    assert sunk.claim == "better"
    assert "no claim" in pull.claim
    before, after = (
        next(number for number in side.numbers if number.name == "rig.pressing_scale")
        for side in (verdict.before, verdict.after)
    )
    assert before.low > 1.0
    assert after.low < 1.0 < after.high
    assert after.value == pytest.approx(1.0, abs=0.15)
