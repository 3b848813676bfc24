"""The same study on a Dask cluster of one scheduler and one worker on this machine."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import rover_pin
import rover_pin.base.jobs.cluster
from rover_pin.base.errors import MissingExtraError, SimulationError
from rover_pin.sweep import Range, Sobol, Study, Values, collect, sweep
from rover_pin.sweep.store import RESULTS

STUDY = Study("clustered", "stub", {"a": Range(0.0, 1.0), "way": Values(["up", "down"])}, Sobol(16), seed=2)


def stub(pause=0.0):
    def outcomes(study, case):
        time.sleep(pause)
        if case.index == 3:
            raise ValueError("no way")
        return {"x": case.values["a"] + np.random.default_rng(case.seed).normal(), "stop": case.values["way"]}

    return outcomes


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def dask(*arguments):
    env = {**os.environ, "PYTHONPATH": str(Path(rover_pin.__file__).parents[1])}
    command = [sys.executable, "-m", "dask", *map(str, arguments)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, env=env, start_new_session=True, **quiet)
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(10.0)


def wait_until_listening(port):
    deadline = time.monotonic() + 300.0
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the scheduler did not start within 5 min")


@contextmanager
def scheduler():
    port = free_port()
    with dask("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard") as process:
        wait_until_listening(port)
        yield f"tcp://127.0.0.1:{port}", process


@contextmanager
def cluster(tmp_path):
    pytest.importorskip("distributed")
    with scheduler() as (address, process):
        where = ("--host", "127.0.0.1", "--local-directory", tmp_path / "dask", "--no-dashboard")
        with dask("worker", address, "--nthreads", 1, *where):
            yield address, process


@pytest.mark.slow
def test_a_cluster_gives_the_table_of_one_core(tmp_path):
    table = sweep(STUDY, tmp_path / "here", workers=1, case_function=stub()).table
    with cluster(tmp_path) as (address, _):
        there = sweep(STUDY, tmp_path / "there", scheduler=address, case_function=stub()).table
    pd.testing.assert_frame_equal(there, table)
    assert (tmp_path / "there" / RESULTS).read_bytes() == (tmp_path / "here" / RESULTS).read_bytes()
    assert list(there["error"].dropna()) == ["ValueError: no way"]


@pytest.mark.slow
def test_lost_scheduler_is_reported_and_the_sweep_resumes(tmp_path):
    table = sweep(STUDY, tmp_path / "whole", workers=1, case_function=stub()).table

    with cluster(tmp_path) as (address, process):
        group, ordinary = process.pid, stub(0.05)

        def killing(study, case):
            if case.index == 8:
                os.killpg(group, signal.SIGKILL)
            return ordinary(study, case)

        killing.__qualname__ = stub().__qualname__
        with pytest.raises(SimulationError, match=r"tcp://127.0.0.1:\d+"):
            sweep(STUDY, tmp_path / "out", scheduler=address, case_function=killing)
    assert 0 < len(collect(tmp_path / "out")) < 16
    pd.testing.assert_frame_equal(sweep(STUDY, tmp_path / "out", workers=1, case_function=stub()).table, table)


@pytest.mark.slow
def test_a_case_that_kills_its_worker_is_a_row_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")

    def deadly(study, case):
        return os._exit(3) if case.index == 5 else {"x": 1.0}

    with cluster(tmp_path) as (address, _):
        table = sweep(STUDY, tmp_path / "out", scheduler=address, case_function=deadly).table
    assert table["error"][5].startswith("KilledWorker: ")
    assert table["x"].notna().sum() >= 14


def test_a_missing_dask_is_told_with_the_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r'pip install "dask'):
        sweep(STUDY, tmp_path / "out", scheduler="tcp://127.0.0.1:8786", case_function=stub())
