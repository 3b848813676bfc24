"""A trace names, stacks and judges its channels, and comes back exactly from its files."""

import json
import math
import re
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.logs.drive_log import load_trace, save_trace
from rover_pin.simulation.trace.files import MAX_READING
from rover_pin.simulation.trace.trace import Trace

T = np.linspace(0.1, 1.0, 10)


def drive(**extra):
    channels = {
        "t_s": T,
        "duty_fl": 0.55 + 0.0 * T,
        "slip_fl": 0.1 * T,
        "slip_rr": 0.2 * T,
        "current_fl_A": T,
        "current_rr_A": 2.0 * T,
        "body_x": 0.05 * T,
        "body_y": 0.0 * T,
        "body_pitch": -0.2 * T,
        **extra,
    }
    return Trace(channels, {}, {"stop": "duration", "rover": "nexus6"})


def test_a_trace_is_a_mapping_of_its_channels():
    trace = drive()
    assert isinstance(trace, Mapping)
    assert list(trace) == list(trace.keys()) == list(trace.channels)
    assert len(trace) == len(trace.channels)
    assert {name: values[-1] for name, values in trace.items()}["slip_rr"] == pytest.approx(0.2)
    assert [values.shape for values in trace.values()] == [(10,)] * len(trace)
    assert {**trace}.keys() == trace.channels.keys()
    assert trace.get("slip_ml") is None
    assert trace.get("slip_fl") is trace["slip_fl"]


def test_arrays_are_copies_and_read_only():
    x = T.copy()
    trace = Trace({"t_s": x})
    x[0] = -1.0
    assert trace.t[0] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        trace["t_s"][0] = 0.0


def test_summary():
    summary = drive().summary()
    assert summary["stop"] == "duration"
    assert summary["end_time_s"] == 1.0
    assert summary["distance_m"] == pytest.approx(0.045)
    assert summary["max_pitch_deg"] == pytest.approx(math.degrees(0.2))
    assert summary["mean_slip"] == pytest.approx(0.15 * 0.55)
    assert json.loads(json.dumps(summary)) == summary


def energies(missing=0.0, shift=1.0):
    soil, kinetic, potential = shift * T**2, shift * np.sin(T), -3.0 * shift * T
    motor = soil + kinetic + potential + 0.5 * shift * T + missing * shift * (T - T[0])
    return Trace(
        {
            "t_s": T,
            "energy_motor": motor + 7.0,
            "energy_electric": 100.0 * T,
            "energy_soil": soil,
            "energy_stops": 0.5 * shift * T,
            "energy_kinetic": kinetic,
            "energy_potential": potential + 40.0,
        }
    )


def test_energy_balance():
    assert energies().energy_error() == pytest.approx(0.0, abs=1e-14)
    assert energies(0.3).energy_error() == pytest.approx(0.3 / 3.0)
    assert energies(shift=0.0).energy_error() == 0.0
    assert energies(0.3).summary()["energy_error"] == pytest.approx(0.1)
    assert math.isnan(Trace({name: energies()[name][:1] for name in energies().channels}).energy_error())


def test_unknown_channels_name_the_close_ones():
    with pytest.raises(ParameterError, match=r"'slip_lf':.*'slip_fl'\?"):
        drive()["slip_lf"]
    with pytest.raises(ParameterError, match="no channel 'slop_fl'"):
        drive().unit("slop_fl")
    assert np.isnan(drive().stack("duty")[:, 1]).all(), "a wheel without a duty, beside one with it"
    with pytest.raises(ParameterError, match="no channel 'torque_"):
        drive().stack("torque")
    named = Trace({"t_s": T}, {}, {"file": "climb.csv"})
    with pytest.raises(DataError, match=r"climb.csv:.*slip_fl"):
        named.need("slip_fl")


@pytest.mark.parametrize(
    ("channels", "says"),
    [
        ({"slip_fl": T}, "t_s"),
        ({"t_s": T, "slip_fl": T[:-1]}, "'slip_fl' has shape (9,), t_s (10,)"),
        ({"t_s": [0.0, 1.0, 1.0]}, "1 s at row 2"),
        ({"t_s": [0.0, np.nan, 1.0]}, "nan s"),
        ({"t_s": [0.0, np.inf]}, "inf s"),
    ],
)
def test_refusals(channels, says):
    with pytest.raises(DataError, match=re.escape(says)):
        Trace(channels)


def same(first, second):
    return first.units == second.units and all(
        np.array_equal(first[name], second[name], equal_nan=True) for name in {**first.channels, **second.channels}
    )


ATTRS = {
    "stop": 'buried: "fl"\nat 3 s',
    "dt_s": 1e-7,
    "symmetric": True,
    "effects": ["A", "B"],
    "settings": {"terrain.wall_angle_deg": 40, "nested": {"è": 1.5}},
    "wheels": ["fl"],
    "start": {"x": 1.0, "y": 0.0, "yaw": -0.5},
    "purpose": "test",
}


READINGS = st.floats(-MAX_READING, MAX_READING) | st.sampled_from([math.nan, math.inf, -math.inf])


@pytest.mark.parametrize("name", ["log", "log.v2", "trace.parquet"])
@given(values=hnp.arrays(float, (4, 3), elements=READINGS))
def test_save_and_load_exactly(tmp_path_factory, name, values):
    trace = Trace(
        {"t_s": T[:4] / 3.0, "slip_fl": values[:, 0], "a": values[:, 1], "b": values[:, 2]}, {"a": "kg"}, ATTRS
    )
    path = tmp_path_factory.mktemp("trace") / name
    assert save_trace(trace, path) == path
    again = load_trace(path)
    assert same(trace, again)
    assert {key: again.attrs[key] for key in ATTRS} == ATTRS


def test_a_parquet_of_others_is_a_run_too(tmp_path):
    drive().to_frame().assign(count=range(10)).drop(columns="body_y").to_parquet(tmp_path / "run.parquet")
    assert load_trace(tmp_path / "run.parquet")["count"][3] == 3.0


def test_values_that_cannot_be_saved_are_refused(tmp_path):
    strange = Trace({"t_s": T}, {}, {"rig": object()})
    with pytest.raises(DataError, match="'rig' = <object object"):
        save_trace(strange, tmp_path / "log")
    with pytest.raises(DataError, match="<object"):
        save_trace(strange, tmp_path / "trace.parquet")
    with pytest.raises(DataError, match=r"saved.*folder"):
        save_trace(drive(), tmp_path / "trace.csv")
    with pytest.raises(DataError, match=r"'run'.*rows"):
        save_trace(Trace({"t_s": np.zeros(0)}), tmp_path / "log")
    assert list(tmp_path.iterdir()) == []
