"""SIGTERM and Ctrl-C end a job with its worker processes, and what was finished is kept and named."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import rover_pin
from rover_pin.base.errors import MissingExtraError, ParameterError, SimulationError
from rover_pin.base.jobs.cluster import MAX_JOBS_AT_ONCE, batch_size, results, workers_of
from rover_pin.cli.app import app
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from rover_pin.sweep import collect
from rover_pin.sweep.store import ROWS
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy
from rover_pin.tuning.tune import tune_gains
from tests.experiments.drive_log import drive_sets
from tests.sweep import test_sweep_cluster

SWEEP = """
import os, sys, time
from rover_pin.sweep import Range, Sobol, Study, sweep
from rover_pin.cli.terminal import stoppable
out = sys.argv[1]
def slow(study, case):
    open(f"{out}.{os.getpid()}", "w").close()
    time.sleep(0.0 if case.index < 3 else 60.0)
    return {}
if __name__ == "__main__":
    import typer
    app = typer.Typer()
    @app.command()
    def main(folder: str):
        with stoppable():
            sweep(Study("slow", "stub", {"a": Range(0.0, 1.0)}, Sobol(8)), folder, workers=2, case_function=slow)
    app()
"""


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def until(condition, seconds=300.0):
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


def rows_in(out):
    """Return how many cases the sweep in a folder has finished."""
    file = out / ROWS
    return file.read_bytes().count(b"\n") if file.exists() else 0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes in /proc")
@pytest.mark.parametrize(("stop", "send"), [(signal.SIGTERM, os.kill), (signal.SIGINT, os.killpg)])
def test_a_stopped_sweep_leaves_no_workers_and_says_what_is_kept(tmp_path, stop, send):
    """SIGTERM as `kill` sends it, to the program alone; Ctrl-C as a terminal does, to its workers as well.

    A shell lets what it starts in the background ignore SIGINT, and these tests with it. No tool of the system is
    there: where loky lacks psutil it looks for workers' children by pgrep, and without that the program hung.
    """
    script, out = tmp_path / "slow.py", tmp_path / "out"
    script.write_text(SWEEP)
    env = {**os.environ, "PYTHONPATH": str(Path(rover_pin.__file__).parents[1]), "PATH": str(tmp_path)}
    process = subprocess.Popen(
        [sys.executable, str(script), str(out)], env=env, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert until(lambda: rows_in(out) == 3)
    workers = [int(file.name.rpartition(".")[2]) for file in tmp_path.glob("out.*")]
    assert workers
    send(process.pid, stop)
    error_output = process.communicate(timeout=300)[1]
    assert process.returncode == 128 + stop, error_output
    assert re.search(rf"\b3 of 8\b.*{re.escape(str(out))}", error_output)
    assert "Traceback" not in error_output
    assert until(lambda: not any(map(alive, workers)))
    assert len(collect(out)) == 3
    assert not (out / ".rover_pin.lock").exists()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes in /proc")
def test_workers_of_a_killed_sweep_end_by_themselves(tmp_path):
    """They used to go on with their case, and then wait for another."""
    script, out = tmp_path / "slow.py", tmp_path / "out"
    script.write_text(SWEEP)
    env = {**os.environ, "PYTHONPATH": str(Path(rover_pin.__file__).parents[1])}
    process = subprocess.Popen([sys.executable, str(script), str(out)], env=env, stderr=subprocess.DEVNULL)
    assert until(lambda: rows_in(out) == 3)
    workers = [int(file.name.rpartition(".")[2]) for file in tmp_path.glob("out.*")]
    assert all(map(alive, workers))
    process.kill()
    process.wait()
    assert until(lambda: not any(map(alive, workers)), 20.0)


@pytest.fixture
def run(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(app, list(words))


def test_a_second_run_says_what_it_replaces(run, tmp_path):
    assert run("curve").stderr == ""
    again = run("curve")
    assert "out/curve:" in again.stderr
    assert "traction.csv, traction.png." in again.stderr.rstrip()
    for json_too in (run("drive", "flat", "--set", "duration=0.1", "--json") for _ in range(2)):
        assert json.loads(json_too.stdout)["scenario"] == "flat"
    assert "log/drive.toml, snapshots.png, history.png" in json_too.stderr


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
        first_worker = test_sweep_cluster.dask("worker", address, *where, "--local-directory", folder / "a")
        second_worker = test_sweep_cluster.dask("worker", address, *where, "--local-directory", folder / "b")
        with first_worker as first, second_worker as second, workers_of(-1, address) as client:
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
    at_once = batch_size(jobs, workers)
    assert 1 <= at_once <= MAX_JOBS_AT_ONCE
    assert at_once == 1 or 2 * at_once * workers <= jobs


def test_short_jobs_come_back_in_order():
    jobs = [(number,) for number in range(11)]
    assert list(results(math.sqrt, jobs, 2, short=True)) == [math.sqrt(number) for number in range(11)]


@pytest.mark.nightly
def test_what_a_killed_worker_was_at_is_run_again(tmp_path):
    with two_workers(tmp_path) as (_, workers, client):
        returned = results(killing(tmp_path, workers[0].pid), [(n,) for n in range(60)], client)
        assert list(returned) == [n * n for n in range(60)]
    assert (tmp_path / "killed").exists()


@pytest.mark.nightly
def test_a_scheduler_that_goes_away_is_one_sentence(tmp_path):
    with two_workers(tmp_path) as (address, _, client):
        returned = results(killing(tmp_path, 0, -1), [(n,) for n in range(500)], client)
        assert next(returned) == 0
        client.shutdown()
        with pytest.raises(SimulationError, match=re.escape(address)):
            list(returned)


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
        remote_prediction = experiment_of(runs, model, client).predict([model])
    local_tuning = tune_gains(study, tmp_path / "here", workers=1)
    assert killed
    assert (there.gains, there.verdicts()) == (local_tuning.gains, local_tuning.verdicts())
    assert remote_prediction.tobytes() == experiment_of(runs, model, 1).predict([model]).tobytes()


@pytest.mark.nightly
def test_a_whole_loop_on_a_cluster_is_that_of_one_core(tmp_path):
    """From the log to the verdict, one of two workers killed on the way."""
    log = drive_sets.write(tmp_path / "log", (), runs=3, duration=8.0)
    with two_workers(tmp_path) as (address, workers, _):
        messages = []

        def told(line):
            messages.append(line)
            if line.startswith("score test"):
                os.killpg(workers[0].pid, signal.SIGKILL)

        there = close_the_loop(log, progress=told, scheduler=address)
    verdict = close_the_loop(log, jobs=1)
    assert any(line.startswith("score test") for line in messages)
    assert _told(there) == _told(verdict)


def _told(verdict):
    """A verdict without when, where and how long."""
    return {name: value for name, value in verdict.as_dict().items() if name not in ("provenance", "seconds")}


@pytest.mark.parametrize("run", [tune_gains, close_the_loop])
def test_processes_beside_a_scheduler_are_refused(run):
    with pytest.raises(ParameterError, match=r"workers.*scheduler"):
        run(LOG, scheduler="tcp://127.0.0.1:1", **{"workers" if run is tune_gains else "jobs": 2})


def test_a_rig_set_needs_no_cluster():
    with pytest.raises(ParameterError, match="scheduler"):
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
