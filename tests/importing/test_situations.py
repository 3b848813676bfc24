"""Recordings as the field has them: sparse exports, appended files, coarse clocks, lost fixes, MCAP of JSON.

Each kind is built here from one drive, and compared with what the same drive gives when it is recorded well.
"""

import json
import math

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.importing.clock import even_times, restarts, whole_stamps, wrapped_clock
from rover_pin.importing.files.raw import read_raw
from rover_pin.importing.import_log import import_log
from rover_pin.importing.lost_values import drop_lost_values
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.logs.ros_bag import open_bag
from tests.importing import recordings

WHEELS = ("fl", "fr", "bl", "br")


@pytest.fixture(scope="module")
def truth():
    return recordings.truth()


def table_of(truth, **columns):
    plain = {
        "time [s]": truth["t_s"],
        "x [m]": truth["body_x"],
        "y [m]": truth["body_y"],
        "yaw [rad]": truth["body_yaw"],
    }
    rates = {f"wheel_{name}_speed [rad/s]": truth[f"wheel_rate_{name}"] for name in WHEELS}
    return pd.DataFrame(plain | rates | columns)


def imported(table, folder, name="own.csv", **options):
    table.to_csv(folder / name, index=False)
    imported_log = import_log([folder / name], "cart", folder / "log", **options)
    return imported_log, read_drive_log(folder / "log")


def driven(log):
    """Time [s] that the runs last, and the way [m] that they drive."""
    lasts = sum(run.t[-1] - run.t[0] for run in log.runs)
    return lasts, sum(float(np.nansum(np.hypot(np.diff(run["body_x"]), np.diff(run["body_y"])))) for run in log.runs)


@pytest.fixture(scope="module")
def reference(truth, tmp_path_factory):
    return driven(imported(table_of(truth), tmp_path_factory.mktemp("usual"))[1])


def sparse(truth, clocks, late=0.0):
    """Rows that hold the place or the wheels, in turn, as a plotter exports two topics with stamps of their own."""
    t = truth["t_s"] + 10_800.0
    place = pd.DataFrame({"__time": t} | {f"/odom/position/{axis}": truth[f"body_{axis}"] for axis in "xy"})
    place["/odom/orientation/yaw"] = truth["body_yaw"]
    place["/odom/header/stamp/sec"] = np.floor(t)
    place["/odom/header/stamp/nanosec"] = np.round(1e9 * (t - np.floor(t)))
    wheels = pd.DataFrame({"__time": t + 0.03} | {
        f"/joints/wheel_{name}/velocity": np.interp(truth["t_s"] + 0.03, truth["t_s"], truth[f"wheel_rate_{name}"])
        for name in WHEELS})  # fmt: skip
    wheels["/joints/header/stamp/sec"] = np.floor(t + 0.03 + late)
    wheels["/joints/header/stamp/nanosec"] = np.round(1e9 * (t + 0.03 + late - np.floor(t + 0.03 + late)))
    table = pd.concat([place, wheels]).sort_values("__time")
    return table if clocks == "of rows" else table.drop(columns="__time")


@pytest.mark.parametrize("clocks", ["of rows", "of stamps only"])
def test_topics_on_stamps_of_their_own_come_to_one_clock(clocks, truth, reference, tmp_path):
    imported_log, log = imported(sparse(truth, clocks), tmp_path)
    assert driven(log) == pytest.approx(reference, rel=0.02)
    for run in log.runs:
        assert np.isfinite([run["body_x"], run["wheel_rate_fl"]]).mean() > 0.98
    begin = 10.0 * float(imported_log.runs[0].split(" from ")[1].split()[0])
    rows = np.round(begin).astype(int) + np.arange(len(log.runs[0].t))
    assert log.runs[0]["wheel_rate_br"][1:] == pytest.approx(truth["wheel_rate_br"][rows[1:]], abs=0.05)
    assert any("/odom" in note and "/joints" in note for note in imported_log.notes)


def test_series_on_clocks_that_share_no_time_are_refused_by_name(truth, tmp_path):
    with pytest.raises(DataError, match=r"/odom.*/joints.*share no time"):
        imported(sparse(truth, "of stamps only", late=1.7e9), tmp_path)


def test_series_side_by_side_come_to_one_clock(truth, reference, tmp_path):
    """A place at 10 Hz beside wheels at 4 Hz, each with its own times, the shorter columns padded."""
    t = np.arange(0.0, truth["t_s"][-1], 0.25)
    wheels = {"wheel_time [s]": t} | {
        f"wheel_{name}_speed [rad/s]": np.interp(t, truth["t_s"], truth[f"wheel_rate_{name}"]) for name in WHEELS
    }
    place = table_of(truth)[["time [s]", "x [m]", "y [m]", "yaw [rad]"]].add_prefix("tracker_")
    imported_log, log = imported(pd.concat([place, pd.DataFrame(wheels)], axis=1), tmp_path)
    assert driven(log)[1] == pytest.approx(reference[1], rel=0.05)
    assert any("tracker_time" in note and "wheel_time" in note for note in imported_log.notes)


@pytest.mark.parametrize("habit", ["one file", "with the header again", "in milliseconds"])
def test_appended_recordings_are_read_as_two(habit, truth, reference, tmp_path):
    table = table_of(truth)
    if habit == "in milliseconds":
        table = table.assign(**{"time [s]": 1e3 * table["time [s]"]}).rename(columns={"time [s]": "time [ms]"})
    second = table.iloc[:500]
    lines = table.to_csv(index=False).splitlines(), second.to_csv(index=False).splitlines()
    text = "\n".join([*lines[0], *(lines[1] if habit == "with the header again" else lines[1][1:])])
    (tmp_path / "two.csv").write_text(text + "\n")
    imported_log = import_log([tmp_path / "two.csv"], "cart", tmp_path / "log")
    log = read_drive_log(tmp_path / "log")
    assert driven(log)[0] > 1.4 * reference[0]
    assert any("701" in note and "2 recordings" in note for note in imported_log.notes)
    assert any("recording 2" in run for run in imported_log.runs)


def test_a_recording_that_stands_twice_counts_once(truth, reference, tmp_path):
    imported_log, log = imported(pd.concat([table_of(truth), table_of(truth)]), tmp_path)
    assert driven(log)[0] == pytest.approx(reference[0])
    assert any("same rows" in note for note in imported_log.notes)


def test_late_messages_are_no_second_recording():
    t = np.arange(0.0, 50.0, 0.1)
    t[200:203] -= 1.0
    assert restarts(t) == []
    assert restarts(np.concatenate([t, t])) == [500]


@pytest.mark.parametrize("size", [65536.0, 86400.0])
def test_a_full_counter_is_counted_on(size):
    t = np.arange(0.0, 0.5 * size, 10.0) + 0.8 * size
    wrapped = t % size
    counted_on = wrapped_clock(wrapped, restarts(wrapped))
    assert counted_on - counted_on[0] == pytest.approx(t - t[0])


COARSE = {
    "whole seconds": lambda t: [f"{value:.0f}" for value in np.floor(t + 1.7e9)],
    "mm:ss.0": lambda t: [f"{v // 600:02d}:{v % 600 // 10:02d}.{v % 10}" for v in np.floor(10 * t + 550.5).astype(int)],
    "dates in seconds": lambda t: [f"2026-05-01 10:{int(v // 60):02d}:{int(v % 60):02d}" for v in t],
    "ms of the epoch in seconds": lambda t: [f"{1000 * math.floor(v + 1.7e9):d}" for v in t],
}


@pytest.mark.parametrize("form", COARSE)
def test_a_coarse_clock_is_taken_as_even_rows_and_marked(form, tmp_path):
    truth = recordings.truth(rate=20.0)
    table = table_of(truth).drop(columns="time [s]")
    table.insert(0, "time", COARSE[form](truth["t_s"]))
    imported_log, log = imported(table, tmp_path)
    for run in log.runs:
        assert np.diff(run.t) == pytest.approx(0.05, rel=0.01)
    (note,) = [note for note in imported_log.notes if "clock 'time'" in note]
    assert "GUESSED" in note
    assert "1400 rows" in note
    assert str(table["time"].nunique()) in note


def test_times_of_even_rows_are_found_within_the_digits():
    rows = np.arange(900)
    for period, digits in ((0.05, 1.0), (0.037, 1.0), (0.051, 0.1)):
        stamps = np.floor(period * rows / digits) * digits
        assert np.diff(even_times(stamps)) == pytest.approx(period, rel=5e-3)
    uneven = np.sort(np.random.default_rng(0).uniform(0.0, 45.0, 900))
    assert even_times(np.floor(uneven)) is None


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        (lambda t: ["1.73234e+09"] * len(t), ("1732340000", "700 rows")),
        (lambda t: np.floor(t + np.where(t > 40.0, 3.0 * np.sin(t), 0.0)).cumsum() % 97.0, ("falls back", "row")),
        (lambda t: np.floor(np.sort(np.random.default_rng(1).uniform(0, 70, len(t)))), ("distinct", "whole seconds")),
        (lambda t: [f"{v:.2f} h" if v > 1 else "start" for v in t], ("'start'",)),
        (lambda t: [f"0001-01-01T00:{v // 60:02.0f}:{v % 60:04.1f}" for v in t], ("'0001-01-01T00:00:00.0'",)),
    ],
    ids=["six digits", "falls back", "uneven", "words", "year 1"],
)
def test_a_clock_that_cannot_be_read_is_named_with_its_fault(stamps, message, truth, tmp_path):
    table = table_of(truth).drop(columns="time [s]")
    table.insert(0, "time [s]", stamps(truth["t_s"]))
    with pytest.raises(DataError, match="time") as refused:
        imported(table, tmp_path)
    assert all(word in str(refused.value) for word in message)
    assert "row / RATE" in str(refused.value)
    _, log = imported(table, tmp_path, columns={"t_s": "row / 10"})
    assert np.diff(log.runs[0].t) == pytest.approx(0.1)


def test_an_even_column_does_not_replace_a_clock_that_cannot_be_read(truth, tmp_path):
    table = table_of(truth).drop(columns="time [s]")
    table = table.assign(time=[f"0001-01-01T00:00:{v:05.2f}" for v in truth["t_s"]], frame=np.arange(len(table)))
    with pytest.raises(DataError) as refused:
        imported(table, tmp_path)
    assert "'time'" in str(refused.value)
    assert "0001-01-01" in str(refused.value)


def test_a_clock_that_the_user_names_keeps_its_unit(truth, tmp_path):
    """A column of dates is in ns; the user who names it means the dates."""
    stamps = pd.Timestamp("2026-05-01 10:00") + pd.to_timedelta(truth["t_s"], unit="s")
    table = table_of(truth).rename(columns={"time [s]": "other"}).assign(logged=stamps.astype(str))
    imported_log, log = imported(table, tmp_path, columns={"t_s": "logged"})
    assert np.diff(log.runs[0].t) == pytest.approx(0.1, abs=1e-6)
    clock = next(note for note in imported_log.notes if "'logged'" in note)
    assert "dates" in clock
    assert " ns" not in clock


LOST = {
    "0, 0": 0.0,
    "-9999": -9999.0,
    "1e20": 1e20,
    "infinite": np.inf,
    "a number of its own": 12345.678,
    "words": np.nan,
}


@pytest.mark.parametrize("kind", [*LOST, "frozen"])
def test_lost_fixes_are_left_out_with_their_rows(kind, truth, reference, tmp_path):
    table = table_of(truth)
    lost = np.r_[100:105, 220:226, 480:485]
    for name in ("x [m]", "y [m]"):
        values = table[name].to_numpy().copy()
        for rows in (slice(100, 105), slice(220, 226), slice(480, 485)):
            values[rows] = values[rows.start - 1] if kind == "frozen" else LOST[kind]
        table[name] = np.where(np.isnan(values), "NO FIX", values.astype(str)) if kind == "words" else values
    imported_log, log = imported(table, tmp_path)
    notes = " ".join(imported_log.notes)
    assert "x [m]" in notes
    assert "101" in notes
    assert ("NO FIX" if kind == "words" else "inf" if kind == "infinite" else "226") in notes
    left = sum(int(np.isnan(run["body_x"]).sum()) for run in log.runs)
    assert left == pytest.approx(len(lost), abs=1)
    assert driven(log)[0] == pytest.approx(reference[0], rel=0.02)


def test_a_rover_that_drives_over_the_origin_or_stands_loses_nothing(tmp_path):
    t = np.arange(0.0, 60.0, 0.1)
    x = np.round(np.clip(0.1 * (t - 20.0), -2.0, 2.0), 3)
    for y in (0.0 * t, np.where(t < 30.0, 0.0, 0.5)):
        table = pd.DataFrame({"t": t, "x": x, "y": y, "w_fl": np.clip(t, 0.0, 1.0)})
        stored, notes = drop_lost_values(tmp_path / "a.csv", table, ())
        assert notes == []
        pd.testing.assert_frame_equal(stored, table)


def test_slow_receivers_are_not_frozen(tmp_path):
    """A place of 1 Hz that is repeated in rows of 20 Hz."""
    t = np.arange(0.0, 60.0, 0.05)
    floor = np.floor(t)
    table = pd.DataFrame({"t": t, "x": 0.1 * floor, "y": 0.02 * floor})
    assert drop_lost_values(tmp_path / "a.csv", table, ())[1] == []


def test_a_place_that_is_lost_most_of_the_time_is_refused_with_value_and_rows(truth, tmp_path):
    table = table_of(truth)
    table.loc[200:, ["x [m]", "y [m]"]] = -9999.0
    with pytest.raises(DataError, match=r"x \[m\].*-9999.*500 rows.*201"):
        imported(table, tmp_path)


def json_mcap(truth, folder, encoding="json", packed=True, profile=""):
    mcap = pytest.importorskip("mcap.writer")
    path = folder / "log.mcap"
    with path.open("wb") as file:
        writer = mcap.Writer(file, compression=mcap.CompressionType.ZSTD if packed else mcap.CompressionType.NONE)
        writer.start(profile=profile, library="recorder")
        schema = writer.register_schema(name="any", encoding="jsonschema", data=b"{}")
        pose, wheels = (writer.register_channel(topic, encoding, schema) for topic in ("/pose", "/wheels"))
        for row, t in enumerate(truth["t_s"]):
            at = recordings.EPOCH + round(1e9 * t)
            place = {name: float(truth[f"body_{name}"][row]) for name in ("x", "y", "yaw")}
            rates = {name: float(truth[f"wheel_rate_{name}"][row]) for name in WHEELS}
            for channel, data in ((pose, {"position": place}), (wheels, rates)):
                writer.add_message(channel, log_time=at + 4_000_000, publish_time=at, data=json.dumps(data).encode())
        writer.finish()
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_mcap_of_json_becomes_the_log_of_the_same_drive(packed, truth, reference, tmp_path):
    if packed:
        pytest.importorskip("rosbags")
    import_log([json_mcap(truth, tmp_path, packed=packed)], "cart", tmp_path / "log")
    assert driven(read_drive_log(tmp_path / "log"))[1] == pytest.approx(reference[1], rel=0.02)


def test_mcap_of_another_encoding_is_refused_with_what_it_holds(truth, tmp_path):
    with pytest.raises(DataError, match=r"/pose \(700 messages of any, protobuf\).*mcap cat --json"):
        import_log([json_mcap(truth, tmp_path, "protobuf", packed=False)], "cart", tmp_path / "log")


def test_a_drive_log_that_names_an_mcap_of_json_is_sent_to_the_importer(truth, tmp_path):
    pytest.importorskip("rosbags")
    with pytest.raises(DataError, match="import-log"), open_bag(json_mcap(truth, tmp_path, packed=False)):
        pass


def test_lines_of_json_as_the_converter_prints_them_are_read(truth, reference, tmp_path):
    lines = []
    for row, t in enumerate(truth["t_s"]):
        stamp = f"{recordings.EPOCH // 10**9 + int(t)}.{round(1e9 * (t % 1.0)):09d}"
        place = {"x": truth["body_x"][row], "y": truth["body_y"][row], "yaw": truth["body_yaw"][row]}
        rates = {"name": list(WHEELS), "velocity": [truth[f"wheel_rate_{name}"][row] for name in WHEELS]}
        for topic, data in (("/pose", place), ("/joints", rates)):
            lines.append(json.dumps({"topic": topic, "log_time": stamp, "publish_time": stamp, "data": data}))
    (tmp_path / "log.jsonl").write_text("\n".join(lines))
    import_log([tmp_path / "log.jsonl"], "cart", tmp_path / "log")
    assert driven(read_drive_log(tmp_path / "log"))[1] == pytest.approx(reference[1], rel=0.02)
    (tmp_path / "bad.jsonl").write_text('{"topic": "/a"}\n')
    with pytest.raises(DataError, match="line 1"):
        read_raw(tmp_path / "bad.jsonl")


def test_mcap_of_ros1_messages_is_read(truth, tmp_path):
    rosbags, mcap = pytest.importorskip("rosbags.typesys"), pytest.importorskip("mcap.writer")
    types = rosbags.get_typestore(rosbags.Stores.ROS1_NOETIC)
    path, channels = tmp_path / "drive.mcap", {}
    with path.open("wb") as file:
        writer = mcap.Writer(file, compression=mcap.CompressionType.NONE)
        writer.start(profile="ros1", library="recorder")
        for at, topic, message in recordings.messages(truth, types):
            if topic not in channels:
                text = types.generate_msgdef(message.__msgtype__)[0].encode()
                schema = writer.register_schema(message.__msgtype__.replace("/msg/", "/"), "ros1msg", text)
                channels[topic] = writer.register_channel(topic, "ros1", schema)
            writer.add_message(channels[topic], at, bytes(types.serialize_ros1(message, message.__msgtype__)), at)
        writer.finish()
    table = read_raw(path).table
    assert table["/mocap/rover.pose.position.x"].to_numpy() == pytest.approx(truth["body_x"], abs=1e-6)
    assert table[f"/joint_states.velocity[{recordings.JOINTS['br']}]"].to_numpy() == pytest.approx(
        truth["wheel_rate_br"], abs=1e-6
    )


@pytest.mark.parametrize("missing", WHEELS)
def test_a_wheel_without_a_rate_is_named_and_the_others_are_taken(missing, truth, tmp_path):
    table = table_of(truth).drop(columns=f"wheel_{missing}_speed [rad/s]")
    for name in WHEELS:
        if name != missing:
            table[f"current_{name}_A"] = 0.2 + 0.1 * np.sin(truth["t_s"])
    imported_log, log = imported(table, tmp_path)
    for kind in ("rate", "motor current"):
        assert any(line.startswith(f"no {kind} of {missing} (3 of 4") for line in imported_log.lacks)
    assert f"wheel_rate_{missing}" not in log.runs[0]
    assert {name for name in log.runs[0].channels if name.startswith("current_")} == {
        f"current_{name}_A" for name in WHEELS if name != missing
    }


@pytest.mark.parametrize("candidates", [True, False])
def test_a_duty_that_is_not_recorded_is_its_sides_or_none(candidates, truth, tmp_path):
    duty = np.clip(truth["wheel_rate_fl"] / 3.0, -1.0, 1.0)
    columns = {f"duty_{name}": duty * (1.0 if candidates or name != "fr" else 0.9) for name in WHEELS}
    imported_log, log = imported(table_of(truth, **columns).drop(columns="duty_bl"), tmp_path)
    assert ("duty_bl" in log.runs[0]) is candidates
    if candidates:
        assert np.array_equal(log.runs[0]["duty_bl"], log.runs[0]["duty_fl"])
        assert any(line.startswith("duty_bl") and "GUESSED" in line for line in imported_log.columns)
    else:
        assert any("duty_bl is not recorded" in note for note in imported_log.notes)
        assert log.runs[0].rate_driven


def test_stamps_in_two_columns_are_one_also_where_rows_lack_them():
    table = pd.DataFrame(
        {"a.stamp.sec": [np.nan, 5.0, 6.0], "a.stamp.nanosec": [np.nan, 5e8, 0.0], "x": [1.0, 2.0, 3.0]}
    )
    joined = whole_stamps(table)
    assert joined["a.stamp [s]"].to_numpy() == pytest.approx([np.nan, 5.5, 6.0], nan_ok=True)
    assert list(joined) == ["a.stamp [s]", "x"]


@pytest.mark.parametrize("pattern", ["{} [{}]", "{}({})", "{} / {}", '"{}, {}"', "{} in {}", "{}_{}", "{} {{{}}}"])
@pytest.mark.parametrize(
    ("length", "per_metre", "angle", "per_radian", "rate", "per_rate"),
    [
        ("m", 1.0, "rad", 1.0, "rad/s", 1.0),
        ("mm", 1e3, "deg", 180.0 / math.pi, "rpm", 30.0 / math.pi),
        ("cm", 1e2, "mrad", 1e3, "1/min", 30.0 / math.pi),
        ("ft", 1.0 / 0.3048, "\u00b0", 180.0 / math.pi, "rev/min", 30.0 / math.pi),
        ("in", 1.0 / 0.0254, "Grad", 180.0 / math.pi, "Hz", 0.5 / math.pi),
    ],
)
def test_units_in_a_header_are_those_of_the_numbers(
    pattern, length, per_metre, angle, per_radian, rate, per_rate, truth, tmp_path
):
    if pattern in ("{}_{}", "{} {{{}}}") and length in ("cm", "ft", "in"):
        pytest.skip("only units of the usual spellings stand behind an underscore")
    columns = {("time", "s"): truth["t_s"], ("yaw", angle): per_radian * truth["body_yaw"]}
    columns |= {(axis, length): per_metre * truth[f"body_{axis}"] for axis in "xy"}
    columns |= {(f"wheel {name} speed", rate): per_rate * truth[f"wheel_rate_{name}"] for name in WHEELS}
    rows = pd.DataFrame({str(at): values for at, values in enumerate(columns.values())})
    text = ",".join(pattern.format(*name) for name in columns) + "\n" + rows.to_csv(index=False, header=False)
    (tmp_path / "own.csv").write_text(text)
    imported_log = import_log([tmp_path / "own.csv"], "cart", tmp_path / "log")
    run = read_drive_log(tmp_path / "log").runs[0]
    begin = round(10.0 * float(imported_log.runs[0].split(" from ")[1].split()[0]))
    rows = slice(begin, begin + len(run.t))
    for name in ("body_x", "body_y", "wheel_rate_fl", "wheel_rate_br"):
        assert run[name] == pytest.approx(truth[name][rows], abs=1e-6), name
    assert np.abs(np.angle(np.exp(1j * (run["body_yaw"] - truth["body_yaw"][rows])))).max() < 1e-6


def test_columns_of_one_name_are_numbered_wheels(truth, tmp_path):
    table = table_of(truth)
    table.columns = ["time", "x [m]", "y [m]", "yaw [rad]", *["velocity [rad/s]"] * 4]
    imported_log, log = imported(table, tmp_path)
    assert sum(line.startswith("wheel_rate_") for line in imported_log.columns) == 4
    begin = round(10.0 * float(imported_log.runs[0].split(" from ")[1].split()[0]))
    for name in WHEELS:
        assert log.runs[0][f"wheel_rate_{name}"] == pytest.approx(
            truth[f"wheel_rate_{name}"][begin:][: len(log.runs[0].t)]
        )


HABITS_OF_TEXT = {
    "a word in a cell": lambda text: text.replace(text.split("\n")[40].split(",")[1], "n.v.", 1).encode(),
    "comma and semicolon": lambda text: text.replace(",", ";").replace(".", ",").encode(),
    "quoted commas": lambda text: "\n".join(
        [
            text.split("\n")[0],
            *(",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(",")) for line in text.split("\n")[1:-1]),
        ]
    ).encode(),
    "byte-order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 without a mark": lambda text: text.encode("utf-16-le"),
}


@pytest.mark.parametrize("habit", HABITS_OF_TEXT)
def test_texts_of_all_habits_hold_the_same_drive(habit, truth, reference, tmp_path):
    text = table_of(truth).to_csv(index=False, float_format="%.6f")
    (tmp_path / "own.csv").write_bytes(HABITS_OF_TEXT[habit](text))
    import_log([tmp_path / "own.csv"], "cart", tmp_path / "log")
    assert driven(read_drive_log(tmp_path / "log")) == pytest.approx(reference, rel=1e-2)
