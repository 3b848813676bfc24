"""The command line as a user runs it."""

import logging
import sys

import pytest
from hypothesis import settings

from rover_pin.cli.app import main

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(autouse=True)
def spoken_as_before():
    """Let no test that asked for quiet keep the next one quiet."""
    yield
    logging.getLogger("rover_pin").setLevel(logging.NOTSET)


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
