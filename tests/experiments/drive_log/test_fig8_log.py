"""The drive log of Fig 8 that comes along: what it holds, what the base model makes of it, and what a loop finds.

It is made by `tests/oracle/blind`, which shares no code with the package; drive.toml says what is hidden.
"""

import importlib
import importlib.util
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.identify import identify

ROOT = Path(__file__).parents[3]
KEPT = ROOT / "studies" / "results" / "steepening-slope"
"""The model and the verdict that the loop wrote, verdict.json without its rounds."""
DATA = ROOT / "studies" / "data" / "steepening-slope"
BLIND = ROOT / "tests" / "oracle" / "blind" / "__init__.py"
_spec = importlib.util.spec_from_file_location("blind", BLIND)
sys.modules.setdefault("blind", importlib.util.module_from_spec(_spec))
_spec.loader.exec_module(sys.modules["blind"])
fig8 = importlib.import_module("blind.fig8")
KINDS, WHEELS = (getattr(importlib.import_module("blind.sensors"), name) for name in ("KINDS", "WHEELS"))


@pytest.fixture(scope="module")
def log():
    return read_drive_log(DATA)


def test_it_is_small_and_says_that_it_is_simulated():
    assert sum(file.stat().st_size for file in DATA.iterdir()) < 1.5e6
    header = (DATA / "drive.toml").read_text().splitlines()[:3]
    assert all(line.startswith("#") for line in header)
    assert "SIMULATED" in header[0]


def test_section_4_tells_the_soil_from_it():
    """The declared k of 3.5 mm is wrong; steady windows of the same log say which is right."""
    k, phi = (identify(DATA)[name].number for name in ("k", "phi"))
    assert k.low < fig8.TRUE["k"] < k.high < 0.002
    assert phi.low < fig8.TRUE["phi"] < phi.high


def test_it_declares_another_soil_than_the_true_one(log):
    assert log.metadata.soil["k"]["value"] == pytest.approx(3.5)
    assert fig8.TRUE["k"] == 0.0015
    assert math.degrees(fig8.TRUE["phi"]) == pytest.approx(log.metadata.soil["phi"]["value"])


def kept():
    return json.loads((KEPT / "verdict.json").read_text(encoding="utf-8"))


TRUE = {
    "DiggingMemory.c_d": fig8.TRUE["DiggingMemory.c_d"],
    "DiggingMemory.length": fig8.TRUE["DiggingMemory.length"],
    "DiggingMemory.deepest": 0.5,
    "soil.k": fig8.TRUE["k"],
    "soil.phi": fig8.TRUE["phi"],
    "MotionResistance.R": fig8.TRUE["R"],
}


def test_intervals_that_hold_the_truth_are_those_the_docs_state():
    """Slip grows faster than grip falls: an even ground is fitted weaker than the mean of the uneven one."""
    after = kept()["after"]
    covered = {name for name, true in TRUE.items() if after[name]["low"] < true < after[name]["high"]}
    assert covered == {"soil.k", "DiggingMemory.deepest"}
    off = {name: abs(after[name]["value"] / TRUE[name] - 1.0) for name in TRUE.keys() - covered}
    digging = {"DiggingMemory.c_d": 0.193, "DiggingMemory.length": 0.212}
    assert off == pytest.approx({**digging, "soil.phi": 0.045, "MotionResistance.R": 0.025}, abs=0.005)


@pytest.mark.nightly
def test_the_loop_finds_the_digging():
    verdict, before = close_the_loop(DATA, jobs=2).as_dict(), kept()
    assert verdict["answer"] == Answer.NAMED.value
    assert verdict["named"] == before["named"] == ["DiggingMemory"]
    for name, number in before["after"].items():
        assert verdict["after"][name]["value"] == pytest.approx(
            number["value"], abs=0.3 * (number["high"] - number["low"])
        )
    now, then = (np.mean([run["after"] for run in document["extra"]["free_runs"]]) for document in (verdict, before))
    assert now == pytest.approx(then, rel=0.3)


@pytest.mark.nightly
def test_the_shipped_files_are_what_the_simulator_drives(log):
    """The first three seconds of every run, within the sensors' noise and gains."""
    planned, gains = fig8.plan()
    true = fig8.drive([run for _, _, run in planned["runs"]], 3.0)
    for at, (name, _, _) in enumerate(planned["runs"]):
        shipped = log.run(name)
        for channel, values in true.items():
            if channel.startswith("slip_"):
                continue
            sd, step = next((kind[1:] for kind in KINDS if channel.startswith(kind[0])), (1e-9, 0.0))
            gain = gains["tacho"][WHEELS.index(channel[-2:])] if channel.startswith("wheel_rate_") else 1.0
            expected = gain * values[at][fig8.EVERY - 1 :: fig8.EVERY]
            miss = shipped[channel][: len(expected)] - expected
            turns = 2.0 * np.pi * np.round(miss / (2.0 * np.pi)) if channel == "body_yaw" else 0.0
            assert np.max(np.abs(miss - turns)) < 5.0 * sd + step + 1e-4, (name, channel)
