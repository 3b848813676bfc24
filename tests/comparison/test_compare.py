"""Two of a kind side by side: the sentence and the table say what differs and by how much, refusals one sentence."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Trace, scenario
from rover_pin.base.errors import DataError
from rover_pin.comparison.compare import compare
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.logs.drive_log import save_trace
from rover_pin.simulation.model.toml_file import write_model

KEPT = Path(__file__).parents[2] / "studies" / "results" / "steepening-slope"


def drive(tmp_path, name, **channels):
    t = np.linspace(0.0, 4.0, 41)
    columns = {"t_s": t, "body_x": 0.05 * t, "slip_fl": 0.1 + 0.0 * t, "slip_fr": 0.1 + 0.0 * t, **channels}
    return save_trace(Trace(columns), tmp_path / f"{name}.parquet")


def row(comparison, name):
    return next(row_found for row_found in comparison.rows if row_found.name == name)


def test_drives_are_compared_over_their_common_time(tmp_path):
    t = np.linspace(0.0, 4.0, 41)
    first = drive(tmp_path, "first")
    second = drive(tmp_path, "second", body_x=0.05 * t + 0.003, slip_fl=0.3 + 0.0 * t)
    comparison = compare(first, second)
    assert "3 mm (RMS)" in comparison.sentence
    assert row(comparison, "mean body_x")[1:3] == ("100 mm", "103 mm")
    slip = row(comparison, "mean slip, 2 wheels")
    assert slip[1:3] == ("0.1", "0.2")
    assert slip.note == f"RMS {0.2 / np.sqrt(2):.4g}"  # one wheel off by 0.2, the other not


def test_models_differ_by_an_effect_and_a_number(tmp_path):
    base = scenario("flat").model
    files = [tmp_path / "a.toml", tmp_path / "b.toml"]
    write_model(base, files[0])
    write_model(
        base.replace(soils=(base.soils[0].replace(k=0.0123), *base.soils[1:])).having(SlipSinkage(n_1=0.3)), files[1]
    )
    comparison = compare(*files)
    assert "slip-sinkage" in comparison.sentence
    assert "soil.k " in comparison.sentence
    assert comparison.differences["soil.k"] == pytest.approx(0.0123 - float(base.soils[0].k))
    assert row(comparison, "SlipSinkage.n_1")[1:3] == ("not there", "0.3")
    assert sum(row_found.differs for row_found in comparison.rows) == 3  # the effect, its size, k


def test_a_verdict_is_compared_by_answer_errors_and_intervals(tmp_path):
    second = tmp_path / "other"
    second.mkdir()
    table = json.loads((KEPT / "verdict.json").read_text())
    table |= {"answer": "no effect needed", "effects": []}
    table["held_out"][0]["after"] *= 1.5
    phi = table["after"]["soil.phi"]
    phi |= {name: phi[name] + 0.2 for name in ("value", "low", "high")}
    (second / "verdict.json").write_text(json.dumps(table))
    comparison = compare(KEPT, second)
    assert 'missing" (digging), the second "no effect needed" (nothing).' in comparison.sentence
    numbers = [int(number) for number in re.findall(r"\b\d+\b", comparison.sentence)[:3]]
    assert numbers == [len(table["held_out"]), 0, 1]
    assert "path" in comparison.sentence
    assert "+50%" in comparison.sentence
    assert "soil.phi" in comparison.sentence
    assert row(comparison, "soil.phi").note == "intervals apart"


def test_two_kinds_or_nothing_are_refused_in_one_sentence(tmp_path, run):
    file = drive(tmp_path, "one")
    code, _, err = run("compare", KEPT, file)
    assert code == 2
    assert "verdict" in err
    assert "drive" in err
    for path in (tmp_path, tmp_path / "gone.json"):
        assert "close-loop" in run("compare", path, file)[2]


def test_drives_that_share_nothing_are_refused(tmp_path):
    t = np.linspace(0.0, 1.0, 5)
    trace = save_trace(Trace({"t_s": t, "body_y": t}), tmp_path / "other.parquet")
    late = save_trace(Trace({"t_s": t + 9.0, "body_x": t}), tmp_path / "late.parquet")
    with pytest.raises(DataError, match=r"channel.*common"):
        compare(drive(tmp_path, "one"), trace)
    with pytest.raises(DataError, match=r"one.parquet.*late.parquet.*overlap"):
        compare(drive(tmp_path, "one"), late)


def test_drives_that_were_set_otherwise_say_what_was_set(tmp_path):
    files = [
        save_trace(scenario("flat", duration=0.2, **{"soil.k": k}).drive(), tmp_path / f"{k}.parquet")
        for k in ("10mm", "50mm")
    ]
    assert row(compare(*files), "set soil.k")[1:3] == ("10mm", "50mm")


def test_what_is_compared_can_be_read_by_machines(run):
    code, out, _ = run("compare", KEPT, KEPT / "verdict.json", "--json")
    table = json.loads(out)
    assert code == 0
    assert table["kind"] == "verdicts"
    assert set(table["differences"].values()) == {0.0}
    assert {"name", "first", "second", "change", "note", "differs"} == set(table["rows"][0])
