"""Sweeps on this machine: equal tables for any workers, failures as rows, resuming after a kill."""

import csv
import dataclasses
import io
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import rover_pin
from rover_pin.base.errors import DataError, MissingExtraError, ParameterError, SimulationError
from rover_pin.sweep import Grid, Range, Study, Values, collect, sweep
from rover_pin.sweep import store as store_module
from rover_pin.sweep.store import RESULTS, ROWS

STUDY = Study("trial", "stub", {"a": Range(0.0, 1.0), "b": Values([1, 2]), "way": Values(["up", "down"])}, Grid(4))


def stub():
    """Return a case function that no worker can import, so that it travels by value."""

    def outcomes(study, case):
        if case.values["a"] == 1.0 and case.values["b"] == 2:
            raise SimulationError(f"the rover fell at {case.values['way']}")
        noise = np.random.default_rng(case.seed).normal()
        return {"x": case.values["a"] * case.values["b"] + noise, "far": noise > 0.0, "stop": case.values["way"]}

    return outcomes


def files(folder):
    return {name: (folder / name).read_bytes() for name in (RESULTS, "results.csv")}


def test_tables_are_equal_to_the_byte_for_one_and_two_workers(tmp_path):
    table = sweep(STUDY, tmp_path / "one", workers=1, case_function=stub()).table
    two = sweep(STUDY, tmp_path / "two", workers=2, case_function=stub()).table
    pd.testing.assert_frame_equal(table, two)
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_the_table_has_parameters_outcomes_and_reasons(tmp_path):
    table = sweep(STUDY, tmp_path / "out", workers=1, case_function=stub()).table
    assert list(table) == ["case", "repeat", "seed", "key", "a", "b", "way", "far", "stop", "x", "error"]
    assert list(table["case"]) == list(range(16))
    failed = table[table["error"].notna()]
    assert list(failed["error"]) == ["SimulationError: the rover fell at up", "SimulationError: the rover fell at down"]
    assert list(failed["a"]) == [1.0, 1.0]
    assert failed["x"].isna().all()
    case = STUDY.cases()[3]
    assert table["x"][3] == stub()(STUDY, case)["x"]
    pd.testing.assert_frame_equal(collect(tmp_path / "out"), table)
    with (tmp_path / "out" / "results.csv").open() as file:
        values = [float(row["x"] or "nan") for row in csv.DictReader(file)]
    np.testing.assert_array_equal(values, table["x"])


def test_the_summary_counts_failures_and_names_reasons_and_files(tmp_path):
    summary = sweep(STUDY, tmp_path / "out", workers=1, case_function=stub()).summary()
    assert {name: summary[name] for name in ("study", "cases", "failed")} == {
        "study": "trial",
        "cases": 16,
        "failed": 2,
    }
    assert summary["reasons"] == {
        "SimulationError: the rover fell at up": 1,
        "SimulationError: the rover fell at down": 1,
    }
    assert all(Path(file).exists() for file in summary["files"])


def test_a_finished_sweep_runs_nothing_again(tmp_path):
    def forbidden(study, case):
        raise AssertionError("run again")

    forbidden.__qualname__ = stub().__qualname__
    first = sweep(STUDY, tmp_path / "out", workers=1, case_function=stub()).table
    before = files(tmp_path / "out")
    pd.testing.assert_frame_equal(sweep(STUDY, tmp_path / "out", workers=1, case_function=forbidden).table, first)
    assert files(tmp_path / "out") == before


def test_an_interrupted_sweep_goes_on(tmp_path):
    calls = []

    def patience(study, case):
        calls.append(case.index)
        if len(calls) == 6:
            raise KeyboardInterrupt
        return {"x": case.seed % 7}

    with pytest.raises(KeyboardInterrupt):
        sweep(STUDY, tmp_path / "out", workers=1, case_function=patience)
    assert list(collect(tmp_path / "out")["case"]) == [0, 1, 2, 3, 4]
    assert len(sweep(STUDY, tmp_path / "out", workers=1, case_function=patience).table) == 16
    assert sorted(calls) == sorted([*range(16), 5])


def test_a_changed_study_is_refused_with_what_changed(tmp_path):
    sweep(STUDY, tmp_path / "out", workers=1, case_function=stub())
    changed_study = dataclasses.replace(STUDY, duration=5.0, parameters=dict(reversed(STUDY.parameters.items())))
    with pytest.raises(DataError, match=r"5.0;.*name"):
        sweep(changed_study, tmp_path / "out", case_function=stub())
    with pytest.raises(DataError, match=r"case_function was \".*stub.*\", is \"rover_pin.sweep.case.drive_case\""):
        sweep(STUDY, tmp_path / "out")


@pytest.mark.parametrize("study", ["[]", "{}", '{"parameters": 3}', "[" * 100_000])
def test_a_description_that_is_none_is_refused(tmp_path, study):
    (tmp_path / "study.json").write_text(study)
    with pytest.raises(DataError, match=r"study\.json: (it describes|not valid)"):
        collect(tmp_path)


def test_a_file_that_was_changed_makes_another_study(tmp_path):
    model = tmp_path / "model.toml"
    for settings, parameters in (({"model": str(model)}, {}), ({}, {"model": Values([str(model)])})):
        study = dataclasses.replace(STUDY, settings=settings, parameters={**STUDY.parameters, **parameters})
        model.write_text("k = 0.01")
        out = tmp_path / f"out-{len(settings)}"
        sweep(study, out, workers=1, case_function=stub())
        assert sweep(study, out, workers=1, case_function=stub()).taken_over == 16
        model.write_text("k = 0.02")
        with pytest.raises(DataError, match=r"another study \(files: .*model.toml was"):
            sweep(study, out, workers=1, case_function=stub())


def test_results_of_something_else_are_refused(tmp_path):
    sweep(STUDY, tmp_path, workers=1, case_function=lambda study, case: {})
    (tmp_path / ROWS).write_text('{"a": 1.0}\n')
    with pytest.raises(DataError, match=r"rows\.jsonl, line 1:.*sweep"):
        collect(tmp_path)


def test_folders_that_are_no_sweep_are_refused(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    with pytest.raises(DataError, match=r"full:.*folder"):
        sweep(STUDY, tmp_path / "full")
    with pytest.raises(DataError, match=r"thesis.tex:.*results"):
        sweep(STUDY, tmp_path / "full" / "thesis.tex")
    with pytest.raises(DataError, match=r"full:.*study.json"):
        collect(tmp_path / "full")


def test_damaged_files_are_named(tmp_path):
    sweep(STUDY, tmp_path / "out", workers=1, case_function=stub())
    rows = tmp_path / "out" / ROWS
    content = rows.read_bytes()
    rows.write_bytes(b"{]\n" + content)
    with pytest.raises(DataError, match=r"rows.jsonl, line 1:"):
        collect(tmp_path / "out")
    rows.write_bytes(content)
    (tmp_path / "out" / "study.json").write_text("{")
    with pytest.raises(DataError, match=r"study.json: not valid JSON"):
        collect(tmp_path / "out")


def test_a_function_that_cannot_travel_is_told(tmp_path):
    with (tmp_path / "log").open("w") as log, pytest.raises(ParameterError, match=r"cannot.*processes"):
        sweep(STUDY, tmp_path / "out", workers=2, case_function=lambda study, case: {"x": log.write("")})


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (3.0, "DataError: .*float.*mapping"),
        ({"a": 1.0}, "DataError: .*'a'"),
        ({"seed": 1.0}, "DataError: .*'seed'"),
        ({"x": [1.0]}, "DataError: .*'x' has the type list"),
    ],
)
def test_outcomes_that_fit_no_column_are_reasons(tmp_path, returned, message):
    table = sweep(STUDY, tmp_path / "out", workers=1, case_function=lambda study, case: returned).table
    assert table["error"].str.match(message).all()


@pytest.mark.parametrize("workers", [1, 2])
def test_what_the_machine_lacks_stops_the_sweep_and_is_no_result(tmp_path, workers):
    def lacking(study, case):
        raise MissingExtraError("No C compiler found.")

    with pytest.raises(MissingExtraError, match=r"No C compiler found"):
        sweep(STUDY, tmp_path / "out", workers=workers, case_function=lacking)
    assert collect(tmp_path / "out").empty


@pytest.mark.slow
def test_dead_worker_is_reported_and_finished_cases_are_kept(tmp_path):
    def deadly(study, case):
        if case.index == 9:
            time.sleep(1.0)
            os._exit(3)
        return {"x": 1.0}

    with pytest.raises(SimulationError, match=r"A.*finished"):
        sweep(STUDY, tmp_path / "out", workers=2, case_function=deadly)
    collected = collect(tmp_path / "out")
    assert 9 not in set(collected["case"])
    assert len(collected) > 4


SCRIPT = """
import time
import numpy as np
from rover_pin.sweep import Sobol, Range, Study, sweep

def slowly(study, case):
    time.sleep(0.1)
    if case.index == 20:
        raise ValueError("no way")
    return {"x": np.random.default_rng(case.seed).normal() + case.values["a"]}

study = Study("killed", "stub", {"a": Range(0.0, 1.0)}, Sobol(32), seed=5)
sweep(study, "FOLDER", workers=2, case_function=slowly)
"""


def test_a_line_that_a_killed_sweep_left_incomplete_is_run_again(tmp_path):
    table = sweep(STUDY, tmp_path / "whole", workers=1, case_function=stub()).table
    sweep(STUDY, tmp_path / "torn", workers=1, case_function=stub())
    rows = tmp_path / "torn" / ROWS
    rows.write_bytes(rows.read_bytes()[:-7])
    assert len(collect(tmp_path / "torn")) == len(table) - 1
    again = sweep(STUDY, tmp_path / "torn", workers=1, case_function=stub())
    assert again.taken_over == len(table) - 1
    assert files(tmp_path / "torn") == files(tmp_path / "whole")


def test_a_sweep_without_pyarrow_leaves_a_csv(tmp_path, monkeypatch):
    monkeypatch.setattr(store_module, "find_spec", lambda name: None)
    table = sweep(STUDY, tmp_path, workers=1, case_function=stub()).table
    assert not (tmp_path / RESULTS).exists()
    assert list(pd.read_csv(tmp_path / "results.csv")["case"]) == list(table["case"])


@pytest.mark.slow
def test_a_killed_sweep_resumes_to_the_same_table(tmp_path):
    def started(folder):
        script = tmp_path / "killed.py"
        script.write_text(textwrap.dedent(SCRIPT).replace("FOLDER", str(tmp_path / folder)))
        env = {**os.environ, "PYTHONPATH": str(Path(rover_pin.__file__).parents[1])}
        return subprocess.Popen([sys.executable, str(script)], env=env, start_new_session=True, stderr=subprocess.PIPE)

    process = started("killed")
    rows = tmp_path / "killed" / ROWS
    deadline = time.monotonic() + 300.0
    while (
        (rows.read_bytes().count(b"\n") if rows.exists() else 0) < 10
        and process.poll() is None
        and time.monotonic() < deadline
    ):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    finished = collect(tmp_path / "killed")
    assert 10 <= len(finished) < 32

    for folder in ("killed", "whole"):
        process = started(folder)
        printed = process.communicate(timeout=300.0)[1].decode()
        assert process.returncode == 0, printed
        assert printed.startswith(f"killed: {len(finished) if folder == 'killed' else 0} of 32 cases, 0 failed")
        assert "killed: 32 of 32 cases" in printed
    assert files(tmp_path / "killed") == files(tmp_path / "whole")
    assert json.loads((tmp_path / "whole" / "study.json").read_text())["plan"] == {"kind": "Sobol", "cases": 32}


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_a_bar_with_failures_and_the_time_left(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    sweep(STUDY, tmp_path / "out", workers=1, case_function=stub())
    bar = sys.stderr.getvalue()
    assert "16/16" in bar
    assert "2 failed" in bar
    assert re.search(r"0:00:00\S* left", bar)
