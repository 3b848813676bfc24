"""From a URDF and a recording of wheel rates and poses to an answer by four commands, for rovers that nobody here made.

The recordings are of `tests/oracle/field_log.py`, which shares no code with the package: 10 Hz, a pose that drifts, no
terrain, no duties, no soil.
"""

import json
from pathlib import Path

import pytest

from tests.oracle import field_log


def answered(run, rover, **options):
    """Run the four commands in an empty folder; return close-loop's exit code, verdict and error."""
    field_log.write(Path(), rover, **options)
    assert run("new-rover", "rover.urdf")[0] == 0
    assert run("check-urdf", "rover.toml")[0] == 0
    code, out, err = run("import-log", "recording.csv", "--rover", "rover.toml", "--out", "log", "--json")
    if code:
        return code, None, err
    assert json.loads(out)["next"] == "rover-pin close-loop log"
    code, out, err = run("close-loop", "log", "--out", "out", "--json")
    return code, json.loads(out) if code == 0 else None, err


@pytest.mark.nightly
@pytest.mark.xfail(
    strict=True, reason="wheels that roll on a radius of 3 % more pass for it; said: something acts besides"
)
def test_drag_without_a_differential_is_like_a_tether(run):
    code, verdict, _ = answered(run, field_log.bogies, seconds=30.0, drag=(20.0, 15.0))
    assert code == 0
    assert verdict["answer"] in ("an effect is missing", "like an effect of the list"), verdict["sentence"]
    assert verdict["effects"] == ["TetherDrag"], verdict["sentence"]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("rover", "options"),
    [("bogies", {"seconds": 30.0, "seed": 7}), ("skid", {"runs": 3, "seconds": 20.0, "seed": 2, "sides": 0.3})],
)
def test_where_nothing_is_hidden_nothing_is_named(run, rover, options):
    """The cart's noise was learnt after 110 columns had taken half of it: "none of these", -10 N in one moment."""
    code, verdict, _ = answered(run, getattr(field_log, rover), **options)
    assert code == 0
    assert verdict["answer"] == "no effect needed", verdict["sentence"]


@pytest.mark.nightly
def test_a_pose_that_is_odometry_is_refused_in_one_sentence(run):
    code, _, err = answered(run, field_log.skid, runs=1, seconds=12.0, odometry=True)
    assert code == 2
    assert "odometry" in err
    assert err.count("\n") == 1
