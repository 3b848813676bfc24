"""SIGTERM and Ctrl-C end a job with its worker processes, and what was finished is kept and named."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import rover_pin
from rover_pin.cli.app import app
from rover_pin.sweep import collect

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
    assert until(lambda: len(list((out / "parts").glob("*.parquet"))) == 3)
    workers = [int(file.name.rpartition(".")[2]) for file in tmp_path.glob("out.*")]
    assert workers
    send(process.pid, stop)
    told = process.communicate(timeout=300)[1]
    assert process.returncode == 128 + stop, told
    assert f"rover-pin: stopped: 3 of 8 cases are kept in {out}" in told
    assert "Traceback" not in told
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
    assert until(lambda: len(list((out / "parts").glob("*.parquet"))) == 3)
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
    assert "out/curve: an earlier" in again.stderr
    assert "own: traction.csv, traction.png." in again.stderr.rstrip()
    for json_too in (run("drive", "flat", "--set", "duration=0.1", "--json") for _ in range(2)):
        assert json.loads(json_too.stdout)["scenario"] == "flat"
    assert "log/drive.toml, snapshots.png, history.png." in json_too.stderr
