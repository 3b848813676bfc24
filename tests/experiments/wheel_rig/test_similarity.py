"""Runs made as functions of one dimensionless group are told so, and a group that does not matter is not."""

import csv
import itertools
import math
import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.experiments.wheel_rig.describe import channel_residuals, draft_effect
from rover_pin.experiments.wheel_rig.similarity import ANGLE, LOAD, SLIP, TRAVEL, collapses, simplest, slip_of_travel
from rover_pin.measurements.rig_reading import read_rig_set
from tests.experiments.drafts import SameLaw, effect_in

RATIOS, ANGLES, LOADS = (0.3, 0.55, 0.8, 1.1, 1.6, 2.5), (0.0, 0.4, 0.8), (20.0, 45.0)
R, B = 0.0625, 0.06
RIG = f"""
kind = "wheel-rig"
[wheel]
r = {{ value = {R}, unit = "m" }}
b = {{ value = {B}, unit = "m" }}
[noise]
drawbar_pull_over_load = 0.004
sinkage = {{ value = 0.1, unit = "mm" }}
lateral_over_load = 0.004
"""


def made(folder, pull, depth, side, angles=ANGLES):
    """Runs at ratios r omega / V, slip angles and loads; pull, side / W and h / r as functions of all three."""
    random, rows = np.random.default_rng(2), ["level,slip,slip_angle_rad,load_N,drawbar_pull_N,sinkage_m,lateral_N"]
    runs = itertools.product(RATIOS, angles, LOADS)
    for at, (ratio, beta, W) in enumerate(runs):
        v, group = math.cos(beta), (ratio, beta, W / LOADS[0])
        noise = random.normal(size=3)
        f, h, y = pull(*group) + 0.004 * noise[0], depth(*group) + 0.0016 * noise[1], side(*group) + 0.004 * noise[2]
        rows.append(f"{at},{(ratio - v) / max(ratio, v):.9f},{beta},{W},{W * f:.7f},{R * h:.9f},{W * y:.7f}")
    (folder / "rig.toml").write_text(RIG)
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    return read_rig_set(folder)


def slipping(ratio):
    return (ratio - 1.0) / max(ratio, 1.0)


def test_each_channel_collapses_on_what_it_was_made_of(tmp_path):
    """Pull on r omega / V alone, sinkage on the load alone, side force on both travel and angle."""
    data = made(
        tmp_path,
        lambda ratio, beta, W: 0.5 * math.tanh(2 * slipping(ratio)),
        lambda ratio, beta, W: 0.2 * W**0.6,
        lambda ratio, beta, W: math.sin(beta) * (0.6 - 0.3 * slipping(ratio)),
    )
    pull, sinkage, side = simplest(collapses(data)).values()
    assert pull.groups == (TRAVEL,)
    assert sinkage.groups == (LOAD,)
    assert set(side.groups) == {TRAVEL, ANGLE}
    for row in (pull, sinkage, side):
        assert row.share > 0.99
        assert row.scatter < 3 * row.noise


def test_slip_along_the_heading_is_told_from_that_of_the_travel(tmp_path):
    def pull(ratio, beta, W):
        v = math.cos(beta)
        return 0.4 * (ratio - v) / max(ratio, v)

    data = made(tmp_path, pull, lambda ratio, beta, W: 0.3 + 0.1 * beta, lambda ratio, beta, W: 0.2 * beta)
    simplest_law = simplest(collapses(data))
    assert simplest_law["drawbar pull / W"].groups == (SLIP,)
    assert simplest_law["h / r"].groups == (ANGLE,)


@pytest.mark.slow
def test_what_is_a_function_of_nothing_is_told_so(tmp_path):
    """Of 18 channels of noise at most two are said to collapse."""
    lines = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        noise = lambda ratio, beta, W, random=random: 0.2 + 0.05 * random.normal()  # noqa: E731
        lines += simplest(collapses(made(tmp_path, noise, noise, noise, angles=(0.0, 0.5)))).values()
    assert sum(row.groups != () for row in lines) <= 2
    assert "collapses on no group" in lines[0].sentence


def test_the_command_writes_table_and_figure(tmp_path, run, monkeypatch):
    made(
        tmp_path,
        lambda ratio, beta, W: 0.5 * math.tanh(2 * slipping(ratio)),
        lambda ratio, beta, W: 0.2 * W**0.6,
        lambda ratio, beta, W: 0.0,
        angles=(0.0,),
    )
    monkeypatch.chdir(tmp_path)
    code, output, _ = run("check-data", str(tmp_path), "--similarity", "--out", "here")
    assert code == 0
    assert re.search(r"drawbar pull / W .*r omega / V", output)
    assert "h / r collapses on W / (gamma b r^2)" in output
    rows = list(csv.DictReader(Path("here/similarity.csv").read_text().splitlines()))
    assert {row["groups"] for row in rows if row["chosen"] == "True"} == {TRAVEL, LOAD}
    assert Path("here/similarity.png").read_bytes().startswith(b"\x89PNG")
    code, _, refused = run("check-data", "steepening-slope", "--similarity")
    assert code == 2
    assert "rig.toml" in refused


def test_a_draft_of_a_wheel_askew_is_of_the_whole_travel(tmp_path):
    """2 + 3 S' N more pull and (4 - 5 S') sin beta N more side force than a model has, S' over the travel."""
    flat = lambda ratio, beta, W: 0.3 + 0.01 * ratio + 0.02 * beta  # noqa: E731
    data = made(tmp_path, flat, flat, flat)
    S, beta = slip_of_travel(data), np.asarray(data.slip_angle)
    pull, sunk, side = data.channels
    missing = (2.0 + 3.0 * S, 0.0 * S, (4.0 - 5.0 * S) * np.sin(beta))
    left = channel_residuals(
        data, np.array([row / channel.sd for row, channel in zip(missing, (pull, sunk, side), strict=True)])
    )
    assert left[0].powers == pytest.approx([2.0, 3.0], abs=1e-6)
    assert left[2].powers == pytest.approx([4.0, -5.0], abs=1e-6)
    assert "+2 +3 S' N" in left[0].sentence
    assert "+4 -5 S' N sin beta" in left[2].sentence
    drafted = draft_effect(data, left)
    law = SameLaw(drafted.effect, effect_in(drafted.text, tmp_path))
    W = float(np.mean(data.load))
    for slip, angle in ((0.5, 0.4), (-0.3, 0.8), (0.2, 0.0)):
        rim, v = (1.0, 1 - slip) if slip > 0 else (1 + slip, 1.0)
        V = v / math.cos(angle)
        contact = Contact(
            slip, -v * math.tan(angle), 0.01, v, -v * math.tan(angle), 0.0, rim, 0.0, 0.0, Wheel(), Soil()
        )
        added, of_travel = law.load(contact, Load(f_n=W), ()), (rim - V) / max(rim, V)
        assert float(added.f_t) == pytest.approx(2.0 + 3.0 * of_travel, abs=1e-5)
        assert float(added.f_y) == pytest.approx((4.0 - 5.0 * of_travel) * math.sin(angle), abs=1e-5)
    contact = contact._replace(S=ca.SX.sym("S"))
    assert isinstance(law.drafted.load(contact, Load(f_n=W), ()).f_t, ca.SX)
