"""Tuning on a model of a file: its effects reach every evaluation, and what was found for one is not another's."""

import dataclasses
from pathlib import Path

import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.control.slip_control import Gains
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import write_model
from rover_pin.tuning.drives import Control, build, controller_of, full_score, reduced_score, seal
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.study import DriveCase, Effort, SlipLaw, TuningStudy
from rover_pin.tuning.tune import tune_gains

ROOT = Path(__file__).parents[2]
SAND = (("duration", 5.0), ("soil.k", 0.01), ("terrain.angle_deg", 8.0), ("terrain.start", 0.0))
CASE = DriveCase("incline", "incline", SAND)
STUDY = TuningStudy("small", (CASE,), (DriveCase("flat", "flat", (("duration", 4.0),)),))
CONTROL = Control.of("true", SlipLaw(Gains()))


def written(path, *effects, **settings):
    model = scenario("flat", **settings).model
    for effect in effects:
        model = model.having(effect)
    return write_model(model, path)


def on(path, study=STUDY):
    return seal(study.on_model(path)).training[0]


@pytest.mark.parametrize(
    "effect",
    [SupplySag(R_b=15.0), MultiPass(stiffening=1.0, shear_stiffening=2.0), SlipSinkage(n_1=1.5)],
    ids=lambda effect: type(effect).__name__,
)
def test_effect_of_the_file_changes_the_full_and_reduced_score(tmp_path, effect):
    plain, lacking = on(written(tmp_path / "plain.toml")), on(written(tmp_path / "lacking.toml", effect))
    for score in (full_score, reduced_score):
        before, after = (score(case, CONTROL)[0] for case in (plain, lacking))
        assert abs(after - before) > 1e-4
    full, reduced = (score(lacking, CONTROL)[0] - score(plain, CONTROL)[0] for score in (full_score, reduced_score))
    assert reduced == pytest.approx(full, rel=0.5)


def test_a_model_file_is_worth_the_settings_that_made_it(tmp_path):
    """Gravity, soil, motor and an effect, written and read back, against the same as settings of the drive."""
    settings = {"gravity": 3.7, "soil.phi_deg": 33.0, "motor.resistance": 30.0, "gear_friction": 0.1}
    settings |= {"effect.NormalDamping.d": 150.0}
    case = on(written(tmp_path / "model.toml", **settings))
    plain = dataclasses.replace(CASE, settings=(*SAND, *settings.items()))
    # the resistance that makes the flat cruise is the file's, of its own k, and stays when a drive changes k
    resistance = float(build(case).model.effect(MotionResistance).R)
    plain = dataclasses.replace(plain, settings=(*plain.settings, ("effect.MotionResistance.R", resistance)))
    assert reduced_score(case, CONTROL) == pytest.approx(reduced_score(plain, CONTROL), rel=1e-9)
    assert full_score(case, CONTROL) == pytest.approx(full_score(plain, CONTROL), rel=1e-6)
    assert controller_of(case, CONTROL).limit == controller_of(plain, CONTROL).limit


def test_eq_9_reads_the_rims_of_the_models_own_wheels(tmp_path):
    folder = ROOT / "urdf"
    path = write_model(scenario("flat", rover=str(folder / "cart.toml")).model, tmp_path / "model.toml", rover="cart")
    case = on(path)
    radius = float(build(case).model.rover.wheel.r)
    assert radius != float(build(CASE).model.rover.wheel.r)
    assert controller_of(case, Control("eq9", CONTROL.gains)).estimate.r == radius


def test_a_soil_named_by_a_drive_contradicts_the_file(tmp_path):
    path = written(tmp_path / "model.toml")
    named = TuningStudy("s", (DriveCase("sand", "flat", (("soil", "dry-sand"),)),)).on_model(path)
    with pytest.raises(ParameterError, match=r"sand:.*model.toml"):
        tune_gains(named)


def test_a_drive_with_a_model_of_its_own_is_refused(tmp_path):
    study = TuningStudy("s", (DriveCase("own", "flat", (("model", "a.toml"),)),))
    with pytest.raises(ParameterError, match=r"'s':.*a.toml"):
        study.on_model(tmp_path / "b.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "model.toml:.*cannot"),
        ("kind = [", "model.toml:.*TOML"),
        ("kind = 'wheel-rig'", "model.toml: kind = 'wheel-rig'"),
        ("kind = 'drive-model'\n[[effect]]\nname = 'SupplySagg'", "'SupplySagg':.*'SupplySag'"),
        ("kind = 'drive-model'\n[[effect]]\nname = 'A'\nfile = 'gone.py'", "gone.py"),
    ],
)
def test_bad_model_file_is_one_sentence_before_any_drive(tmp_path, text, message):
    path = tmp_path / "model.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(DataError, match=message):
        tune_gains(STUDY.on_model(path), tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()


def test_what_was_found_for_one_model_is_not_taken_for_another(tmp_path):
    """The same path with other content is another evaluation; the old content back again is remembered."""
    path = written(tmp_path / "model.toml", SupplySag(R_b=1.0))
    first = path.read_bytes()
    evaluations = Evaluations(tmp_path, 1, None)
    once = evaluations.run("drives", reduced_score, [(on(path), CONTROL)])
    written(path, SupplySag(R_b=15.0))
    again = evaluations.run("drives", reduced_score, [(on(path), CONTROL)])
    assert evaluations.fresh == 2
    assert again != once
    path.write_bytes(first)
    resumed = Evaluations(tmp_path, 1, None)
    assert resumed.run("drives", reduced_score, [(on(path), CONTROL)]) == once
    assert resumed.fresh == 0


def test_a_model_that_changes_while_it_is_tuned_for_is_refused(tmp_path):
    path = written(tmp_path / "model.toml")
    case = on(path)
    written(path, SupplySag())
    with pytest.raises(DataError, match=r"model.toml:.*changed"):
        full_score(case, CONTROL)


def test_the_seal_covers_a_rover_and_an_effect_of_the_users_own(tmp_path):
    for name in ("cart.toml", "cart.urdf"):
        (tmp_path / name).write_bytes((ROOT / "urdf" / name).read_bytes())
    effect = tmp_path / "own.py"
    effect.write_text("# an effect\n")
    path = tmp_path / "model.toml"
    path.write_text("kind = 'drive-model'\nrover = 'cart.toml'\n[[effect]]\nname = 'Own'\nfile = 'own.py'\n")
    seals = [on(path).seal]
    for file in (effect, tmp_path / "cart.urdf", tmp_path / "cart.toml", path):
        file.write_bytes(file.read_bytes() + b"\n")
        seals.append(on(path).seal)
    assert len(set(seals)) == 5


@pytest.mark.slow
def test_gains_of_a_model_say_so(tmp_path):
    path = written(tmp_path / "model.toml", PivotFriction())
    study = dataclasses.replace(STUDY, effort=Effort(5, 0, 0, 1, 1), free={"S_d": (0.05, 0.9)}).on_model(path)
    result = tune_gains(study, tmp_path / "out", workers=1)
    assert f"'small' on {path}" in (tmp_path / "out" / "gains.toml").read_text()
    assert result.summary()["model"] == [str(path)]
    assert "PivotFriction" in result.summary()["warnings"][0]
