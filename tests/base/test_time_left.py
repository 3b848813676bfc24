"""How long work shows how far it is: a bar on a terminal, lines in a log elsewhere."""

import io
import logging
import sys

from rover_pin.base.jobs import time_left
from rover_pin.base.jobs.time_left import showing_progress
from tests.inference import linear_causes as toys


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_a_bar_of_long_work_and_nothing_of_short(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    logging.getLogger("rover_pin").setLevel(logging.INFO)
    assert list(showing_progress(range(4), 4, "fitting pairs of causes")) == [0, 1, 2, 3]
    assert sys.stderr.getvalue() == ""
    monkeypatch.setattr(time_left, "SECONDS_BEFORE_BAR", 0.0)
    assert list(showing_progress(range(4), 4, "fitting pairs of causes")) == [0, 1, 2, 3]
    assert "fitting pairs of causes" in sys.stderr.getvalue()
    assert "4/4" in sys.stderr.getvalue()


def test_a_loop_that_ends_early_leaves_no_bar_behind(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    logging.getLogger("rover_pin").setLevel(logging.INFO)
    monkeypatch.setattr(time_left, "SECONDS_BEFORE_BAR", 0.0)
    for row in showing_progress(range(9), 9, "runs"):
        if row == 3:
            break
    count = len(sys.stderr.getvalue())
    assert count > 0
    logging.getLogger("rover_pin").info("the next line")
    assert "runs" not in sys.stderr.getvalue()[count:]


def test_the_exploration_of_a_rigs_causes_says_how_long_it_takes(monkeypatch, caplog):
    monkeypatch.setattr(time_left, "SECONDS_BETWEEN_LINES", 0.0)
    names = ("a", "b", "c", "d")
    toy, _ = toys.from_the_prior(3, names)
    with caplog.at_level(logging.INFO, "rover_pin"):
        toys.explorer(toy, names).explore()
    lines = [record.getMessage() for record in caplog.records]
    for what in ("fitting each cause alone", "fitting pairs of causes"):
        assert any(line.startswith(what) and "left" in line for line in lines), lines
