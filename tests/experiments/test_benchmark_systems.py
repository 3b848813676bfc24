"""Systems of the kinds of public benchmarks: the hidden effect is named, an effect that is on no list never is.

The study `studies/benchmark_systems.py` does the work and keeps its rows; the nightly test repeats it on other seeds.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.experiments.benchmark_systems import SYSTEMS
from tests.oracle import benchmark_generator as generator

ROOT = Path(__file__).parents[2]
LIMIT = 1.005
"""Of the RMSE over that of the plain fit: ends of two descents differ by less than this."""


def study():
    spec = importlib.util.spec_from_file_location("study_of_benchmarks", ROOT / "studies" / "benchmark_systems.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_kept_rows_name_what_is_hidden_and_nothing_else():
    rows = pd.read_csv(ROOT / "studies" / "results" / "benchmark_systems.csv", keep_default_na=False)
    short = rows[rows["RMSE unseen"] != ""]
    laws = short[~short.hidden.isin(["none", "unlisted"])]
    assert len(laws) == len(SYSTEMS)
    assert (laws.named == laws.hidden).all()
    assert (laws["largest extra"].astype(float) < 0.5).all()
    ratio = laws["RMSE unseen"].astype(float) / laws["RMSE plain fit"].astype(float)
    assert ratio.max() <= LIMIT
    assert (short[short.hidden.isin(["none", "unlisted"])].named == "").all()
    long = rows[rows["RMSE unseen"] == ""]
    assert set(long.samples.astype(int)) == {24840, 131072}
    assert (long.named == long.hidden).all()
    assert long["CPU [s]"].astype(float).max() < 60.0


def test_without_an_effect_the_base_model_predicts_the_data():
    """The generator's formulas and the models agree where nothing is hidden, with the generator's numbers."""
    true = {
        "spring": {"body.stiffness": 6.4e4, "body.damping": 9.0, "body.mass": 1.0},
        "servo": {"shaft.inertia": 0.021, "shaft.viscous": 0.033, "shaft.torque": 0.92},
        "hysteresis": {"body.stiffness": 4.6e4, "body.damping": 11.0, "body.mass": 2.1},
        "motor": {"motor.inertia": 0.0031, "motor.viscous": 0.0052, "motor.k_t": 0.21},
        "tanks": {"vessels.k": 2.6e-5, "vessels.hole_1": 5.2e-5, "vessels.hole_2": 5.6e-5, "vessels.area": 0.012},
    }
    for system, numbers in true.items():
        experiment = SYSTEMS[system].of(generator.made(system, "none", 5, 2, 200))
        model = experiment.with_values(experiment.base_model(), numbers)
        missed = (experiment.observed - experiment.predict([model])[0]) / experiment.sd[:, None]
        assert np.sqrt(np.mean(missed**2)) == pytest.approx(1.0, abs=0.3), "integrated by another rule"


def test_the_generator_is_accurate():
    """Its spring against SciPy's integration with a tolerance of 1e-9, to a tenth of the noise."""
    dt, u, rows, sd = generator.spring(np.random.default_rng(3), "CubicSpring", 60, 1)
    states, q = np.zeros(2), [0.0]
    for value in u[:-1, 0]:
        end = solve_ivp(
            lambda t, x, value=value: [x[1], value - 9.0 * x[1] - 6.4e4 * x[0] - 2.7e8 * x[0] ** 3],
            (0.0, dt), states, rtol=1e-9, atol=1e-12,
        )  # fmt: skip
        states = end.y[:, -1]
        q.append(states[0])
    assert np.abs(rows[0, :, 0] - q).max() < 0.1 * sd[0] + 0.02 * np.abs(q).max()


UNSETTLED_TANKS = (
    "the fit of the overflowing tanks has not reached its minimum (chi2 can fall by 6.6), so that the answer is 'like' "
    "with probability .82, and the RMSE is 1.1 % above that of the plain fit"
)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "system",
    [
        pytest.param(name, marks=pytest.mark.xfail(reason=UNSETTLED_TANKS, strict=True) if name == "tanks" else ())
        for name in generator.SYSTEMS
    ],
)
def test_fresh_sets_name_what_is_hidden(system):
    """Two minutes for all systems; the rows of full length are in the study."""
    study_of = study()
    row = dict(zip(study_of.HEADER, study_of.row_of(system, generator.SYSTEMS[system][1], 91001), strict=True))
    assert row["named"] == generator.SYSTEMS[system][1], row
    assert float(row["largest extra"]) < 0.5, row
    assert float(row["RMSE unseen"]) <= LIMIT * float(row["RMSE plain fit"]), row


@pytest.mark.nightly
@pytest.mark.parametrize("system", generator.SYSTEMS)
def test_a_fresh_effect_that_is_on_no_list_is_not_named(system):
    study_of = study()
    row = dict(zip(study_of.HEADER, study_of.row_of(system, "unlisted", 91001), strict=True))
    assert row["named"] == ""


@pytest.mark.nightly
@pytest.mark.parametrize("system", ["servo", "spring"])
def test_data_of_full_length_take_less_than_a_minute(system):
    study_of = study()
    row = dict(zip(study_of.HEADER, study_of.long_row(system, 91001), strict=True))
    assert row["named"] == generator.SYSTEMS[system][1]
    assert float(row["CPU [s]"]) < 60.0
