"""What close-loop leaves behind: its exit code by the answer, and the commands that repeat it and try its draft."""

import dataclasses
import json
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rover_pin.cli.app import app
from rover_pin.discrepancy.answer import Answer, answers_named
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.loop import close
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.verdict_file import LoopRequest, write_draft
from tests.oracle import brake_generator as hidden


def closed(run, tmp_path, *words, **options):
    data = hidden.write(tmp_path / "brake", **options)
    return run("close-loop", data, "--experiment", "motor_brake", "--out", "out", *words)


def test_an_answer_on_the_list_fails_and_is_written_all_the_same(run, tmp_path):
    code, _, err = closed(run, tmp_path, "--fail-on", "set, named", seed=0, viscous=0.02)
    assert code == 3
    assert f"'{Answer.NAMED.value}'" in err
    assert "--fail-on set, named" in err
    assert json.loads(Path("out/verdict.json").read_text())["answer"] == Answer.NAMED.value


def test_another_answer_does_not(run, tmp_path):
    assert closed(run, tmp_path, "--fail-on", "none-needed,cannot-tell", seed=0, viscous=0.02)[0] == 0


def test_a_word_that_is_no_answer_is_refused_before_any_work(run, tmp_path):
    code, _, err = closed(run, tmp_path, "--fail-on", "nmed", seed=0)
    assert code == 2
    assert "'nmed'" in err
    assert "did you mean 'named'" in err
    assert not Path("out").exists()


@pytest.mark.parametrize("answer", Answer)
def test_every_answer_has_a_word_that_the_help_names(run, answer):
    assert answers_named(answer.word) == (answer,)
    assert answer.word in "".join(run("close-loop", "--help")[1].split())  # a line may end after a hyphen


def test_first_screen_comes_first_and_can_be_opened(run, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    _, out, _ = closed(run, tmp_path, "--open", seed=0, viscous=0.02)
    first, second, third = out.splitlines()[:3]
    assert first == "The model's error comes from viscous friction."
    assert re.match(r"  viscous friction: 0\.020\d? N m s \[", second)
    assert "held-out error current" in second
    assert third.startswith("  nothing (base model): ")
    for head in ("believe it because:", "doubt it because:", "next:"):
        assert head in out
    assert out.rstrip().endswith("written: out/report.html")
    assert [path.rsplit("/", 1)[1] for path in opened] == ["report.html"]
    file_names = sorted(file.name for file in Path("out").iterdir())
    assert file_names == ["causes.png", "points-1.png", "points-2.png", "report.html", "verdict.json"]
    page = Path("out/report.html").read_text()
    assert "model.toml" not in page  # nothing of files that were not written


ASKED = LoopRequest("a folder/of --out data", "its model.toml", Path("mine.py"), "my out", "bed.py", trust=True)
PARTS = {"model": None, "effects": None, "experiment": None, "trust": False}


def plain(value):
    return value if isinstance(value, bool) or value is None else str(value)


def asked_by(line, monkeypatch):
    """What a command line asks the loop for; the loop itself is not run."""
    request = {}

    def stopped(data, model, effects, out, say, **others):
        request.update(data=data, model=model, effects=effects, out=out, **others)
        raise KeyboardInterrupt

    monkeypatch.setattr(close, "close_the_loop", stopped)
    words = shlex.split(line)
    assert words[0] == "rover-pin"
    CliRunner().invoke(app, words[1:])
    return {name: plain(value) for name, value in request.items()}


@pytest.mark.parametrize("left_out", [*PARTS, ""])
def test_command_repeats_the_request_whatever_names_contain(left_out, monkeypatch):
    changed_asked = dataclasses.replace(ASKED, **{name: value for name, value in PARTS.items() if name == left_out})
    observed = asked_by(changed_asked.command, monkeypatch)
    for name in ("data", "out", *PARTS):
        assert observed[name] == plain(getattr(changed_asked, name)), name


def test_command_that_tries_a_draft_starts_from_the_same_model(tmp_path, monkeypatch):
    changed_asked = dataclasses.replace(ASKED, effects=None, experiment=None)
    verdict = Verdict("wheel-rig", Answer.NONE_FITS, "x", "nothing fits", None, draft=Draft("code = 1\n"))
    verdict, [file] = write_draft(verdict, changed_asked, tmp_path / "my out")
    observed = asked_by(verdict.draft.command, monkeypatch)
    assert (observed["data"], observed["model"], observed["trust"]) == (changed_asked.data, changed_asked.model, True)
    assert Path(observed["effects"]) == file
    assert file.read_text() == "code = 1\n"


def test_a_models_file_is_the_start_in_python_too(tmp_path):
    data = Path(__file__).parents[2] / "studies" / "data"
    log, rig = data / "steepening-slope", data / "cmu-smooth-wheel"
    with pytest.raises(close.DataError, match=r"nothing\.toml"):
        close_the_loop(rig, tmp_path / "nothing.toml")
    with pytest.raises(close.DataError, match=r"nothing\.toml"):
        close_the_loop(log, str(tmp_path / "nothing.toml"))
