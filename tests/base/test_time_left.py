"""How far long work is: seldom, by the pace so far, and never where it is over."""

import logging

import pytest

from rover_pin.base.jobs import time_left
from rover_pin.base.jobs.time_left import TimeLeft, format_duration, telling


@pytest.mark.parametrize(("seconds", "said"), [(7.2, "7 s"), (119.0, "119 s"), (600.0, "10 min"), (9000.0, "2.5 h")])
def test_times_are_said_as_one_says_them(seconds, said):
    assert format_duration(seconds) == said


def test_the_rest_takes_as_long_as_what_was_done(caplog):
    now = [0.0]
    left = TimeLeft("replays", lambda: now[0])
    with caplog.at_level(logging.INFO):
        for count in range(1, 11):
            now[0] = 4.0 * count
            left.done(count, 10)
    said = [record.message for record in caplog.records]
    assert said == [
        "replays: 3 of 10, about 28 s left",
        "replays: 6 of 10, about 16 s left",
        "replays: 9 of 10, about 4 s left",
    ]


def test_rows_pass_through_and_short_work_says_nothing(caplog):
    with caplog.at_level(logging.INFO):
        assert list(telling(iter("abc"), 3, "letters")) == ["a", "b", "c"]
    assert not caplog.records


def test_every_row_is_told_where_no_time_is_too_short(caplog, monkeypatch):
    monkeypatch.setattr(time_left, "SECONDS_BETWEEN_LINES", 0.0)
    with caplog.at_level(logging.INFO):
        list(telling(range(3), 3, "replays"))
    assert [record.message.split(",")[0] for record in caplog.records] == ["replays: 1 of 3", "replays: 2 of 3"]
