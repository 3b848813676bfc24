"""A function of time in one file: a law hidden in a pendulum on a servo is named; friction never gives energy."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import rover_pin.experiments.pendulum as shipped
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.pendulum import Pendulum
from rover_pin.loop.close import close_the_loop
from tests.oracle import pendulum_generator as hidden

FILE, ROOT = Path(shipped.__file__), Path(__file__).parents[2]
LAWS = {law.__name__: law for law in Pendulum.laws}


def model_with(bench, **laws):
    model = bench.base_model()
    for name, numbers in laws.items():
        model = model.having(LAWS[name](**numbers))
    return model


def numbers_of(bench, **laws):
    """What `motion` is handed for one model."""
    neutral = {name: law(**law.neutral) for name, law in LAWS.items()}
    records = neutral | bench.records(model_with(bench, **laws))
    return SimpleNamespace(**{key: value for part in records.values() for key, value in part.values().items()})


def lost(bench, **laws):
    """Power that leaves motor, arm and spring (100 rates of the arm), no current flowing; and these rates."""
    n, w = numbers_of(bench, **laws), np.linspace(-5.0, 5.0, 100)
    K, half = n.gear * n.k_t, n.gap / 2
    motor, v, arm = np.linspace(-0.1, 0.1, 100), np.linspace(2.0, -3.0, 100), np.linspace(1.0, -2.0, 100) * 0.05
    (_, dv, _, dw), _ = bench.motion(n, np.array([motor, v, arm, w]), K * v)
    carried = n.stiffness * (motor - arm - np.clip(motor - arm, -half, half))
    weight = n.mass * shipped.EARTH * n.lever * np.sin(arm)
    return -(n.gear**2 * n.rotor_inertia * v * dv + n.inertia * w * dw + weight * w + carried * (v - w)), w, carried


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    hidden.write(folder, length=0.2)
    return Pendulum.read(folder)


@pytest.mark.parametrize("law", hidden.LAWS)
def test_it_predicts_what_the_plain_generator_measures(tmp_path, law):
    """To 0.7 SD of each channel: the smooth sign and the teeth without damping cost that."""
    inside = hidden.write(tmp_path, law, seed=3, noisy=False, true=True)
    bench = Pendulum.read(tmp_path)
    model = model_with(bench, **({law: inside} if inside else {}))
    off = (bench.predict([model])[0] - bench.observed) / bench.sd[:, None]
    assert np.sqrt(np.mean(off**2, axis=(0, 2))).max() < 0.7


def test_without_any_law_no_energy_is_lost_or_won(bench):
    assert lost(bench)[0] == pytest.approx(0.0, abs=1e-12)
    assert lost(bench, Play={"gap": 0.05})[0] == pytest.approx(0.0, abs=1e-12)


def test_each_friction_takes_what_its_law_says(bench):
    sizes = {name: lost(bench, **{name: numbers}) for name, numbers in SIZES.items()}
    for name, (power, w, carried) in sizes.items():
        assert (power >= 0.0).all(), name
        assert power == pytest.approx(np.abs(w) * SIZES_AT[name](np.abs(w), np.abs(carried)), rel=1e-4), name


SIZES = {
    "Coulomb": {"T_c": 0.2},
    "Viscous": {"b": 0.1},
    "Stribeck": {"T_s": 0.3, "share": 0.4, "w_s": 0.5},
    "LoadFriction": {"mu": 0.2},
}
SIZES_AT = {
    "Coulomb": lambda w, carried: 0.2,
    "Viscous": lambda w, carried: 0.1 * w,
    "Stribeck": lambda w, carried: 0.3 * (0.4 + 0.6 * np.exp(-4.0 * w**2)),
    "LoadFriction": lambda w, carried: 0.2 * carried,
}


def test_the_command_names_the_hidden_law(run, tmp_path):
    true = hidden.write(tmp_path / "data", "Viscous", seed=1, length=0.8)["b"]
    code, _, err = run("close-loop", str(tmp_path / "data"), "--experiment", "pendulum", "--out", str(tmp_path / "out"))
    report = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert code == 0, err
    assert report["effects"] == ["Viscous"]
    assert report["after"]["Viscous.b"]["low"] < true < report["after"]["Viscous.b"]["high"]
    assert (tmp_path / "out" / "report.html").is_file()


def test_data_that_it_cannot_read_get_one_sentence(tmp_path):
    hidden.write(tmp_path, length=0.2)
    text = (tmp_path / "bench.toml").read_text()
    (tmp_path / "bench.toml").write_text(text.replace("lever", "leaver"))
    with pytest.raises(ParameterError, match=r"Arm.*'leaver'"):
        Pendulum.read(tmp_path)
    (tmp_path / "bench.toml").write_text(text)
    runs = (tmp_path / "runs.csv").read_text()
    (tmp_path / "runs.csv").write_text(runs.replace("run 0,0.040", "run 0,0.010"))
    with pytest.raises(DataError, match="time_s must increase"):
        Pendulum.read(tmp_path)


def test_blind_pendulums_are_named_and_nulls_are_not():
    """What the page shows of `studies/results`; five intervals, of Stribeck friction and of play, do not hold."""
    rows = pd.read_csv(ROOT / "studies" / "results" / "blind_pendulum.csv", keep_default_na=False)
    laws, nulls = rows[rows["hidden"] != "none"], rows[rows["hidden"] == "none"]
    alone = laws["answer"] == "named"
    assert (laws["named"] == laws["hidden"])[alone].all()
    assert alone.sum() == 19
    assert all(row.hidden in row.set.split(" or ") for row in laws[~alone].itertuples())
    assert (nulls["named"] == "").all()
    missed = laws[laws["interval holds"].astype(str) != "True"]
    assert set(missed["hidden"]) == {"Stribeck", "Play"}
    assert len(missed) == 5


@pytest.mark.nightly
def test_blind_sets_are_named_or_in_the_set_and_nulls_not(tmp_path):
    """A minute and a half; `studies/blind_pendulum.py` has twenty laws and ten nulls on other seeds."""
    for seed, law in enumerate([*hidden.LAWS, "none", "none"], 10):
        hidden.write(tmp_path / str(seed), law, seed)
        verdict = close_the_loop(tmp_path / str(seed), experiment="pendulum")
        if law == "none":
            assert verdict.answer is Answer.NONE_NEEDED, (seed, verdict.summary())
        else:
            assert verdict.answer in (Answer.NAMED, Answer.SET), (seed, verdict.summary())
            assert law in verdict.indistinguishable, (seed, law, verdict.summary())
