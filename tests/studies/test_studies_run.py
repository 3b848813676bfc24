"""Every study and benchmark runs with --quick from any folder, and writes the files that it states."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = sorted(ROOT.glob("studies/*.py"))
SHARED = {ROOT / "studies" / "benchmarks" / f"{name}.py" for name in ("former", "measure_all", "speed_table")}
BENCHMARKS = sorted(set(ROOT.glob("studies/benchmarks/*.py")) - SHARED)
SHORT = {"fig3", "fig6", "fig8_slope"}
"""A few seconds each: part of the default suite. The others together take minutes."""
LONG = {"beyond_the_paper", "blind_improve", "blind_rig", "blind_test", "close_loop_speed", "gravity", "long_log"}
"""Half a minute or more each: nightly."""
FORMER = {"mutation": "HEAD", "process_cost": "f624ee7", "replay_speed": "f624ee7"}
"""The commit whose files a benchmark takes from the history, which a packed checkout lacks."""
SECTIONS = ("Question", "Method", "Result", "What the paper says", "What differs")


def run(file, *options, folder):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-W", "error::RuntimeWarning", str(file), "--quick", *options]
    got = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=600, check=False)
    assert got.returncode == 0, got.stderr[-2000:]
    return got.stdout


def has_commit(commit):
    """Return whether the folder is a clone whose history reaches back to a commit."""
    command = ["git", "cat-file", "-e", f"{commit}^{{commit}}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, check=False).returncode == 0


def marked(files):
    return [pytest.param(file, id=file.stem, marks=mark(file.stem)) for file in files]


def mark(name):
    return pytest.mark.nightly if name in LONG else () if name in SHORT else pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize("file", marked(STUDIES))
def test_a_study_runs_quickly(file, tmp_path):
    out = tmp_path / "results"
    output = run(file, "--out", str(out), folder=tmp_path)
    suffixes = {file_written.suffix for file_written in out.rglob("*") if file_written.is_file()}
    assert ".csv" in suffixes
    assert suffixes & {".png", ".md"}, "a picture, or the table of shares of a blind run"
    assert output.strip()


@pytest.mark.parametrize("file", marked(BENCHMARKS))
def test_a_benchmark_runs_quickly(file, tmp_path):
    if file.stem in FORMER and not has_commit(FORMER[file.stem]):
        pytest.skip(f"no commit {FORMER[file.stem]} here")
    assert re.search(r"\d", run(file, folder=tmp_path))


@pytest.mark.parametrize("file", STUDIES, ids=lambda file: file.stem)
def test_a_study_states_its_question_and_its_result(file):
    text = file.read_text()
    docstring = text.split('"""')[1]
    for section in SECTIONS:
        assert f"\n{section}\n" in docstring
    assert "--quick" in text
    assert "RESULT" not in docstring
    assert "DIFFERS" not in docstring
