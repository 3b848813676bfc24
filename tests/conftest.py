"""The command line as a user runs it."""

import logging
import os
import sys

import pytest

from rover_pin.base.jobs.safe_environment import SAFE_PATH
from rover_pin.cli.app import main


@pytest.fixture(autouse=True)
def as_before():
    """Let no test keep the next one quiet, nor leave it the path of modules of workers amid which it ended."""
    safe_path = os.environ.get(SAFE_PATH)
    yield
    logging.getLogger("rover_pin").setLevel(logging.NOTSET)
    if safe_path is None:
        os.environ.pop(SAFE_PATH, None)


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """Run the command line in an empty folder; return exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)

    def command(*words):
        monkeypatch.setattr(sys, "argv", ["rover-pin", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        return (end.value.code, *capsys.readouterr())

    return command
