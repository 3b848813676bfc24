"""The command that a verdict gives to repeat it, and the one that tries its draft: they ask for what was asked."""

import dataclasses
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rover_pin.cli.app import app
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.loop import close
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.provenance import LoopRequest
from rover_pin.loop.verdict_file import draft_written

ASKED = LoopRequest("a folder/of --out data", "its model.toml", Path("mine.py"), "my out", "bed.py", trust=True)
PARTS = {"model": None, "effects": None, "experiment": None, "trust": False}


def plain(value):
    return value if isinstance(value, bool) or value is None else str(value)


def asked_by(line, monkeypatch):
    """What a command line asks the loop for; the loop itself is not run."""
    seen = {}

    def stopped(data, model, effects, out, say, **others):
        seen.update(data=data, model=model, effects=effects, out=out, **others)
        raise KeyboardInterrupt

    monkeypatch.setattr(close, "close_the_loop", stopped)
    words = shlex.split(line)
    assert words[0] == "rover-pin"
    CliRunner().invoke(app, words[1:])
    return {name: plain(value) for name, value in seen.items()}


@pytest.mark.parametrize("left_out", [*PARTS, ""])
def test_command_repeats_the_request_whatever_names_contain(left_out, monkeypatch):
    asked = dataclasses.replace(ASKED, **{name: value for name, value in PARTS.items() if name == left_out})
    seen = asked_by(asked.command, monkeypatch)
    for name in ("data", "out", *PARTS):
        assert seen[name] == plain(getattr(asked, name)), name


def test_command_that_tries_a_draft_starts_from_the_same_model(tmp_path, monkeypatch):
    asked = dataclasses.replace(ASKED, effects=None, experiment=None)
    verdict = Verdict("wheel-rig", Answer.NONE_FITS, "x", "nothing fits", None, draft=Draft("code = 1\n"))
    verdict, [file] = draft_written(verdict, asked, tmp_path / "my out")
    seen = asked_by(verdict.draft.command, monkeypatch)
    assert (seen["data"], seen["model"], seen["trust"]) == (asked.data, asked.model, True)
    assert Path(seen["effects"]) == file
    assert file.read_text() == "code = 1\n"


def test_a_models_file_is_the_start_in_python_too(tmp_path):
    data = Path(__file__).parents[2] / "studies" / "data"
    log, rig = data / "steepening-slope", data / "cmu-smooth-wheel"
    with pytest.raises(close.DataError, match=r"nothing\.toml"):
        close_the_loop(rig, tmp_path / "nothing.toml")
    with pytest.raises(close.DataError, match=r"nothing\.toml"):
        close_the_loop(log, str(tmp_path / "nothing.toml"))
