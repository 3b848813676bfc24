"""Tuning and closing the loop on a Dask cluster: the results of one core, also where a worker is killed."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import MissingExtraError, ParameterError, SimulationError
from rover_pin.base.jobs.cluster import AT_ONCE, handed_at_once, results, workers_of
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy
from rover_pin.tuning.tune import tune_gains
from tests.experiments.drive_log import drive_sets
from tests.sweep import test_sweep_cluster

ROOT = Path(__file__).parents[2]
LOG = ROOT / "studies" / "data" / "steepening-slope"
STUDY = ROOT / "studies" / "tune_slopes.toml"
RIG = ROOT / "studies" / "data" / "cmu-smooth-wheel"


@contextmanager
def two_workers(folder):
    """A scheduler of this machine's loopback with two workers; yields its address and both processes."""
    pytest.importorskip("distributed")
    with test_sweep_cluster.scheduler() as (address, _):
        where = ("--host", "127.0.0.1", "--no-dashboard", "--nthreads", 1, "--no-nanny")
        one = test_sweep_cluster.dask("worker", address, *where, "--local-directory", folder / "a")
        other = test_sweep_cluster.dask("worker", address, *where, "--local-directory", folder / "b")
        with one as first, other as second, workers_of(-1, address) as client:
            client.wait_for_workers(2, timeout=300)
            yield address, (first, second), client


def killing(folder, pid, at=20):
    """Return a function that squares; at one number it kills the process of this id, once."""

    def square(number):
        time.sleep(0.02)
        if number == at and not (folder / "killed").exists():
            (folder / "killed").write_text("")
            os.killpg(pid, signal.SIGKILL)
        return number * number

    return square


@given(jobs=st.integers(1, 5000), workers=st.integers(1, 64))
def test_short_jobs_are_batched_without_idle_processes(jobs, workers):
    """All of them in one go at most half of what a process has to do, where there is more than a job each."""
    at_once = handed_at_once(jobs, workers)
    assert 1 <= at_once <= AT_ONCE
    assert at_once == 1 or 2 * at_once * workers <= jobs


def test_short_jobs_come_back_in_order():
    asked = [(number,) for number in range(11)]
    assert list(results(math.sqrt, asked, 2, short=True)) == [math.sqrt(number) for number in range(11)]


@pytest.mark.nightly
def test_what_a_killed_worker_was_at_is_run_again(tmp_path):
    with two_workers(tmp_path) as (_, workers, client):
        found = results(killing(tmp_path, workers[0].pid), [(n,) for n in range(60)], client)
        assert list(found) == [n * n for n in range(60)]
    assert (tmp_path / "killed").exists()


@pytest.mark.nightly
def test_a_scheduler_that_goes_away_is_one_sentence(tmp_path):
    with two_workers(tmp_path) as (address, _, client):
        found = results(killing(tmp_path, 0, -1), [(n,) for n in range(500)], client)
        assert next(found) == 0
        client.shutdown()
        with pytest.raises(SimulationError, match=f"The Dask scheduler at {address} went away"):
            list(found)


@pytest.mark.nightly
def test_tuning_and_replays_on_a_cluster_are_those_of_one_core(tmp_path):
    """With one of two workers killed while the tuning is at work."""
    drives = [
        DriveCase(f"incline of {angle}", "incline", (("duration", 4.0), ("terrain.angle_deg", angle)), 0.2)
        for angle in (6.0, 8.0)
    ]
    effort = Effort(population=5, generations=1, starts=1, steps=2, keep=2)
    study = TuningStudy("small", (drives[0],), (drives[1],), {"k_p": (0.01, 5.0), "S_d": (0.05, 0.9)}, effort=effort)
    log = read_drive_log(LOG)
    model = base_model(log)
    runs = logged_runs(log, model.rover)[:2]
    with two_workers(tmp_path) as (address, workers, client):
        killed = []

        def told(stage, done, total):
            if done and not killed:
                killed.append(stage)
                os.killpg(workers[0].pid, signal.SIGKILL)

        there = tune_gains(study, tmp_path / "there", told, scheduler=address)
        far = experiment_of(runs, model, client).predict([model])
    here = tune_gains(study, tmp_path / "here", workers=1)
    assert killed
    assert (there.gains, there.verdicts()) == (here.gains, here.verdicts())
    assert far.tobytes() == experiment_of(runs, model, 1).predict([model]).tobytes()


@pytest.mark.nightly
def test_a_whole_loop_on_a_cluster_is_that_of_one_core(tmp_path):
    """From the log to the verdict, one of two workers killed on the way."""
    log = drive_sets.write(tmp_path / "log", (), runs=3, duration=8.0)
    with two_workers(tmp_path) as (address, workers, _):
        said = []

        def told(line):
            said.append(line)
            if line.startswith("score test"):
                os.killpg(workers[0].pid, signal.SIGKILL)

        there = close_the_loop(log, progress=told, scheduler=address)
    here = close_the_loop(log, jobs=1)
    assert any(line.startswith("score test") for line in said)
    assert _told(there) == _told(here)


def _told(verdict):
    """A verdict without when, where and how long."""
    return {name: value for name, value in verdict.as_dict().items() if name not in ("provenance", "seconds")}


@pytest.mark.parametrize("run", [tune_gains, close_the_loop])
def test_processes_beside_a_scheduler_are_refused(run):
    with pytest.raises(ParameterError, match=r"workers.*scheduler"):
        run(LOG, scheduler="tcp://127.0.0.1:1", **{"workers" if run is tune_gains else "jobs": 2})


def test_a_rig_set_needs_no_cluster():
    with pytest.raises(ParameterError, match="leave scheduler"):
        close_the_loop(RIG, scheduler="tcp://127.0.0.1:1")


def test_a_missing_dask_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="`pip install"):
        close_the_loop(LOG, scheduler="tcp://127.0.0.1:1")


@pytest.mark.nightly
@pytest.mark.parametrize("command", [("close-loop", str(LOG)), ("tune", str(STUDY))], ids=lambda words: words[0])
def test_the_commands_take_a_scheduler(command, tmp_path):
    """Nobody listens there: asked for, and told."""
    pytest.importorskip("distributed")
    words = [sys.executable, "-m", "rover_pin.cli.app", *command, "--scheduler", "tcp://127.0.0.1:1", "--out", "out"]
    run = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2
    assert "answers at 'tcp://127.0.0.1:1'" in run.stderr
