"""`close-loop --fail-on`: an answer on the list ends with code 3 after all is written, any other with 0."""

import json
from pathlib import Path

import pytest

from rover_pin.discrepancy.answer import Answer, answers_named
from tests.oracle import brake_generator as hidden


def closed(run, tmp_path, *words, **how):
    data = hidden.write(tmp_path / "brake", **how)
    return run("close-loop", data, "--experiment", "motor_brake", "--out", "out", *words)


def test_an_answer_on_the_list_fails_and_is_written_all_the_same(run, tmp_path):
    code, _, err = closed(run, tmp_path, "--fail-on", "set, named", seed=0, viscous=0.02)
    assert code == 3
    assert "the answer 'an effect is missing' is one of --fail-on set, named" in err
    assert json.loads(Path("out/verdict.json").read_text())["answer"] == Answer.NAMED.value


def test_another_answer_does_not(run, tmp_path):
    assert closed(run, tmp_path, "--fail-on", "none-needed,cannot-tell", seed=0, viscous=0.02)[0] == 0


def test_a_word_that_is_no_answer_is_refused_before_any_work(run, tmp_path):
    code, _, err = closed(run, tmp_path, "--fail-on", "nmed", seed=0)
    assert code == 2
    assert "'nmed' is no answer of the loop: did you mean 'named'?" in err
    assert not Path("out").exists()


@pytest.mark.parametrize("answer", Answer)
def test_every_answer_has_a_word_that_the_help_names(run, answer):
    assert answers_named(answer.word) == (answer,)
    assert answer.word in "".join(run("close-loop", "--help")[1].split())  # a line may end after a hyphen


def test_first_screen_comes_first_and_can_be_opened(run, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    _, out, _ = closed(run, tmp_path, "--open", seed=0, viscous=0.02)
    first, second = out.splitlines()[:2]
    assert first.startswith("Bearings and grease resist in proportion to speed (viscous friction): 0.020 N m s [")
    assert second.startswith("Current was wrong by ")
    for head in ("believe it because:", "doubt it because:", "next:"):
        assert head in out
    assert out.rstrip().endswith("written: out/report.html")
    assert [each.rsplit("/", 1)[1] for each in opened] == ["report.html"]
    written = sorted(each.name for each in Path("out").iterdir())
    assert written == ["causes.png", "points-1.png", "points-2.png", "report.html", "verdict.json"]
    page = Path("out/report.html").read_text()
    assert "model.toml" not in page  # nothing of files that were not written
