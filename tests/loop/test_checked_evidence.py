"""What close-loop refuses of a drive log, or warns of, identify does too."""

import dataclasses

import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.cli.app import app
from rover_pin.loop.data_check import check_data, checked_evidence
from rover_pin.measurements.reading import read_evidence
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.sensors import Sensors, measured

SCENE = scenario("slope", **{"soil.k": 0.01, "effect.MotionResistance.R": 0.12})


@pytest.fixture(scope="module")
def trace():
    return measured(SCENE.drive(), Sensors(), seed=0)


def written(trace, folder, **changed):
    SCENE.write_log(dataclasses.replace(trace, channels={**trace.channels, **changed}), folder)
    return folder


@pytest.mark.parametrize(
    "change",
    [
        lambda trace: {f"wheel_rate_{each}": -trace[f"wheel_rate_{each}"] for each in trace.wheels},
        lambda trace: {"body_pitch": -trace["body_pitch"]},
        lambda trace: {f"current_{each}_A": 1e3 * trace[f"current_{each}_A"] for each in trace.wheels},
    ],
    ids=["rates backwards", "pitch upside down", "currents in mA"],
)
def test_log_refused_by_close_loop_is_refused_in_the_same_words(trace, tmp_path, change):
    folder = written(trace, tmp_path / "log", **change(trace))
    with pytest.raises(DataError) as by_loop:
        check_data(folder)
    with pytest.raises(DataError) as here:
        checked_evidence(folder)
    assert str(here.value) == str(by_loop.value)
    told = CliRunner().invoke(app, ["identify", str(folder)])
    assert told.exit_code != 0


def test_a_sound_log_is_read_as_ever_and_its_findings_are_told(trace, tmp_path, caplog):
    stuck = trace["body_pitch"].copy()
    x = trace["body_x"].copy()
    x[200] += 0.08
    folder = written(trace, tmp_path / "log", body_x=x, body_pitch=stuck)
    evidence, findings, _ = checked_evidence(folder)
    by_loop = check_data(folder).findings
    assert [each for each in by_loop if each in findings] == list(findings)
    assert any("outlier" in str(each) for each in findings), findings
    plain = read_evidence(folder)
    assert evidence.factor.tobytes() == plain.factor.tobytes()


def test_what_only_the_loop_lacks_is_not_said_of_a_fit(trace, tmp_path):
    """No run drives back, none is repeated, [noise] is doubtful: all that concerns effects, not phi and k."""
    folder = written(trace, tmp_path / "log")
    left = [str(each) for each in check_data(folder).findings if each not in checked_evidence(folder)[1]]
    assert any("look alike" in each for each in left)
    assert not [each for each in checked_evidence(folder)[1] if "look alike" in str(each) or "[noise]" in str(each)]


def test_a_rig_and_a_table_have_no_log_to_check(tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("slip,traction_factor,sd\n0.1,0.05,0.01\n0.4,0.1,0.01\n0.8,0.12,0.01\n")
    evidence, findings, _ = checked_evidence(table)
    assert findings == ()
    assert len(evidence.slip) == 3
