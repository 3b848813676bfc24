"""One process at a time writes to a folder of results; who is killed lets go; what a further run replaces is said."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.files.results_folder import LOCK, alone_in
from rover_pin.loop.close import close_the_loop
from rover_pin.sweep import Grid, Study, Values, sweep
from rover_pin.tuning.study import DriveCase, TuningStudy
from rover_pin.tuning.tune import tune_gains

RIG = Path(__file__).parents[2] / "studies" / "data" / "cmu-smooth-wheel"
HOLDER = """
import sys, time
from rover_pin.base.files.results_folder import alone_in
with alone_in(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path / "out")], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def jobs(out):
    study = Study("one", "stub", {"a": Values([1.0])}, Grid())
    tuning = TuningStudy("one", (DriveCase("flat", "flat"),))
    return {
        "sweep": lambda: sweep(study, out, workers=1, case_function=lambda study, case: {}),
        "tuning": lambda: tune_gains(tuning, out, workers=1),
        "loop": lambda: close_the_loop(RIG, out=out),
    }


def test_who_comes_second_is_told_who_is_at_work(holder, tmp_path):
    out = tmp_path / "out"
    for name, job in jobs(out).items():
        with pytest.raises(DataError, match=rf"out: process {holder.pid} ") as raised:
            job()
        assert len(str(raised.value).splitlines()) == 1, name
    assert sorted(os.listdir(out)) == [LOCK]


def test_a_killed_holder_lets_go(holder, tmp_path):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / "out" / LOCK).exists()
    with alone_in(tmp_path / "out"):
        pass
    assert not list((tmp_path / "out").iterdir())


def test_a_lock_is_no_link_that_leads_elsewhere(tmp_path):
    (tmp_path / "other").write_text("mine")
    (tmp_path / LOCK).symlink_to(tmp_path / "other")
    with pytest.raises(DataError, match=r"folder.*results"), alone_in(tmp_path):
        pass
    assert (tmp_path / "other").read_text() == "mine"
