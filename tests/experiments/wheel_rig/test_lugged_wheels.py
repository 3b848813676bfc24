"""A wheel with lugs in its trench, driving, braking and locked: whatever a bracket finds to carry it is found."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.base.errors import DataError
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
RIM = 0.05


def forces(y, S, wheel, soil):
    """Return f_n, f_t, torque of Eqs (2)-(7) by plain quadrature in theta, at the sinkage y into the trench's floor."""
    r, b = wheel.r, wheel.b
    first = math.acos(1.0 - y / r)
    last = -soil.exit_ratio * first
    theta = 0.5 * (first + last) + 0.5 * (first - last) * NODES
    sigma = (soil.k_1 + soil.k_2 * b) * (r / b) ** soil.n * np.maximum(np.cos(theta) - math.cos(first), 0.0) ** soil.n
    travel = 1.0 - S if S >= 0 else 1.0 / max(1.0 + S, 1e-14)
    slid = r * ((first - theta) - travel * (math.sin(first) - np.sin(theta)))
    tau = (soil.c + sigma * math.tan(soil.phi)) * np.sign(slid) * -np.expm1(-np.abs(slid) / soil.k)
    patch, cos, sin = 0.5 * (first - last) * r * b * WEIGHTS, np.cos(theta), np.sin(theta)
    torque = r * float(patch @ tau)
    pull = min(float(patch @ (tau * cos - sigma * sin)), (1.0 + min(S, 0.0)) * torque / r)  # a soil gives no work
    return float(patch @ (sigma * cos + tau * sin)), pull, torque


def carried(y, S, wheel, soil):
    """Return f_n."""
    return forces(y, S, wheel, soil)[0]


def missing(y, load, *arguments):
    """Return what f_n has beyond the load."""
    return carried(y, *arguments) - load


def trench(S, wheel, lugs, y):
    """Return how deep lugs dig where what they carry off, E h_l (r omega - v) (1 - 2 D / r), is what comes in, D v."""
    travel, rim = RIM * (1.0 - max(S, 0.0)), RIM * (1.0 + min(S, 0.0))
    away = lugs.h_l * lugs.filled * max(rim - travel, 0.0) * min(y / 1e-4, 1.0)
    return away / (travel + 2.0 * away / wheel.r)


def drawn(random):
    """Return a wheel, its lugs, a soil, a slip and a sinkage into the floor, from ranges of this test's own."""
    r = random.uniform(0.03, 0.3)
    wheel = Wheel(r=r, b=r * random.uniform(0.3, 1.6))
    soil = Soil(
        k=float(np.exp(random.uniform(math.log(1e-3), math.log(0.1)))),
        phi=math.radians(random.uniform(15.0, 45.0)),
        c=random.choice([0.0, random.uniform(0.0, 4000.0)]),
        n=random.uniform(0.5, 1.5),
        exit_ratio=random.uniform(-0.1, 0.5),
        k_1=float(np.exp(random.uniform(math.log(1e4), math.log(3e6)))),
    )
    lugs = LugExcavation(h_l=min(random.uniform(0.0, 0.3) * r, 0.05), filled=random.uniform(0.2, 1.5))
    S = float(random.choice([random.uniform(-0.95, 0.0), random.uniform(0.0, 0.97), 1.0, -1.0], p=[0.3, 0.5, 0.1, 0.1]))
    return wheel, lugs, soil, S, r * float(np.exp(random.uniform(math.log(1e-3), math.log(0.8))))


def test_no_lugged_wheel_that_a_bracket_carries_is_lost():
    """1,500 conditions: Newton's method ends where an independent bracketing root does, or says that none is."""
    random, outside, count = np.random.default_rng(2511), 0, 0
    while count < 1500:
        wheel, lugs, soil, S, y = drawn(random)
        load = carried(y, S, wheel, soil)
        if not 0.0 < load < carried(wheel.r, S, wheel, soil):
            continue  # braked on cohesive soil the ground pulls a shallow wheel down: more roots than one
        count += 1
        y = brentq(missing, 1e-9 * wheel.r, wheel.r, args=(load, S, wheel, soil))
        h = y + trench(S, wheel, lugs, y)
        model = RigModel(wheel, soil, (*PAPER, lugs))
        if h > wheel.r:
            outside += 1
            with pytest.raises(DataError, match="no sinkage"):
                model.predict(load, S)
            continue
        assert model.predict(load, S).sinkage[0] == pytest.approx(h, rel=0.02 if S < 0 else 1e-3)
    assert 0 < outside < 100


# --- through the door ------------------------------------------------------------------------------------------------

SAND = Soil(k=0.012, phi=math.radians(31.0), c=100.0, n=1.0, exit_ratio=0.15, k_1=3e5)
WHEEL = Wheel(r=0.09, b=0.08)
SLIPS = (-1.0, -0.5, 0.0, 0.15, 0.3, 0.5, 0.7, 0.9, 1.0)
RIG = """kind = "wheel-rig"
[wheel]
r = { value = 90, unit = "mm" }
b = { value = 80, unit = "mm" }
%s
[noise]
drawbar_pull = { value = 0.5, unit = "N" }
torque = { value = 0.03, unit = "N m" }
sinkage = { value = 0.5, unit = "mm" }
"""


def write(folder, runs, lugs=None, slip=str, wheel=""):
    """Write a set of runs (slip, load); one that nothing carries stands in the soil to two thirds of its radius."""
    random, rows = np.random.default_rng(9), []
    for S, load in runs:
        axle = carried(0.999 * WHEEL.r, S, WHEEL, SAND)
        y = brentq(missing, 1e-6, WHEEL.r, args=(load, S, WHEEL, SAND)) if axle > load else 0.66 * WHEEL.r
        _, pull, torque = forces(y, S, WHEEL, SAND)
        h = y + (trench(S, WHEEL, lugs, y) if lugs else 0.0)
        speeds = RIM * (1.0 + min(S, 0.0)), RIM * (1.0 - max(S, 0.0))
        observed = np.array([pull, torque, h]) + np.array([0.5, 0.03, 5e-4]) * random.normal(size=3)
        rows.append(",".join([slip(S), *map(str, (load, *speeds, *observed))]))
    Path(folder).mkdir()
    names = "slip,load_N,rim_speed_mps,travel_speed_mps,drawbar_pull_N,torque_Nm,sinkage_m"
    Path(folder, "points.csv").write_text("\n".join([names, *rows]) + "\n")
    Path(folder, "rig.toml").write_text(RIG % wheel)


def thrice(slips):
    return [(S, 60.0) for S in slips for _ in range(3)]


def test_the_slip_of_a_locked_wheel_follows_from_its_speeds(run):
    """(r omega - v) / (r omega), as others define it braking, is - infinity where the wheel does not turn."""
    write("mine", thrice(SLIPS), slip=lambda S: "-inf" if S == -1.0 else str(S))
    code, out, _ = run("check-data", "mine")
    assert code == 0
    assert re.search(r"27 runs.* 9 levels.*-1 to 1", out)
    assert "3 of 27" in out
    table = Path("mine/points.csv").read_text().replace("_speed_mps", "_speed_rpm")
    Path("mine/points.csv").write_text(table)
    code, _, err = run("check-data", "mine")
    assert code == 2
    assert re.search(r"slip.*row 1\b", err)


@pytest.mark.nightly
def test_lugged_wheel_is_fitted_from_locked_to_spinning(run):
    """Nothing is hidden: its numbers are found, every level is predicted by the others, and nothing is named."""
    lugs = LugExcavation(h_l=0.008)
    write("mine", thrice(SLIPS), lugs, wheel="lug_height = { value = 8, unit = 'mm' }")
    code, out, _ = run("close-loop", "mine", "--json", "--out", "out")
    report = json.loads(out)
    assert (code, report["answer"]) == (0, "no effect needed")
    page_text = re.sub(r"data:[^\"]*", "", Path("out/report.html").read_text())  # without its figures
    assert not re.search(r"\b(nan|inf)\b", page_text)
    for name, true in (("soil.k", SAND.k), ("soil.phi", SAND.phi), ("LugExcavation.h_l", lugs.h_l)):
        assert report["after"][name]["low"] < true < report["after"][name]["high"]
    assert all(score["after"] < 2 * score["floor"] and not score["lost"] for score in report["held_out"])
    assert any(line.startswith("DiggingMemory was not tried") for line in report["cautions"])


@pytest.mark.slow
def test_run_that_no_sinkage_carries_is_named_and_fits_nothing(run):
    """One load of 20 kN among 60 N: every command names the run, and no number is fitted around it."""
    write("mine", [*thrice(SLIPS[2:-1]), (0.5, 20000.0)])
    why = r"sinkage.*load = 20000 N at slip = 0\.5"
    assert re.search(why, run("check-data", "mine")[1])
    for command in (("identify", "mine"), ("close-loop", "mine", "--json", "--out", "out")):
        code, out, err = run(*command)
        assert (code, out) == (2, "")
        assert re.search(why, err)
    assert not Path("out").exists() or not list(Path("out").glob("verdict.json"))


SOFT = "[soil]\nk_1 = { value = 2, unit = 'kPa' }"


def base_fit():
    experiment = RigExperiment((read_rig_set("mine"),))
    model = experiment.base_model()
    return calibrated(experiment, model, experiment.uncertain(model))


def test_a_fit_steps_out_of_soil_that_carries_nothing(run):
    """The declared sand is 150 times softer than the true one: the fit starts where every run is carried."""
    write("mine", thrice(SLIPS[1:6]), wheel=SOFT)
    assert "14 other of 15 runs" in run("check-data", "mine")[1]
    fitted = base_fit()
    assert fitted.value("soil.k_1") == pytest.approx(SAND.k_1, rel=0.1)
    assert fitted.misfit < 2


def test_where_the_stiffness_is_not_fitted_the_run_is_named(run):
    """Without a sinkage nothing tells k_1."""
    write("mine", thrice(SLIPS[1:6]), wheel=SOFT)
    rows = [line.rpartition(",")[0] for line in Path("mine/points.csv").read_text().splitlines()]
    Path("mine/points.csv").write_text("\n".join(rows) + "\n")
    code, _, err = run("close-loop", "mine")
    assert code == 2
    assert re.search(r"sinkage.*load = 60 N", err)
