"""A recording is read as its columns agree on one motion, or asked about: layouts of others, and each trap alone."""

import math
import struct
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest
from scipy.io import savemat

from rover_pin import scenario
from rover_pin.base.errors import DataError
from rover_pin.base.files.column_names import corner, word
from rover_pin.importing.evidence import is_settled
from rover_pin.importing.files.raw import read_raw
from rover_pin.importing.import_log import import_log
from rover_pin.importing.joint_choice import Signals, turn_evidence
from rover_pin.logs.drive_log import read_drive_log
from tests.importing import recordings

ROOT = Path(__file__).parents[2]
WHEELS = ("fl", "fr", "bl", "br")


@pytest.fixture(scope="module")
def foreign():
    """The study's module, which needs rosbags; its generator shares nothing with the importer."""
    return pytest.importorskip("foreign_logs", exc_type=ImportError)


@pytest.mark.slow
def test_no_layout_of_others_is_silently_wrong(foreign):
    """Twelve layouts of a seed that the study does not report."""
    rows = pd.DataFrame([foreign.tried(31, number) for number in range(12)])
    assert not list(rows[rows["answer"] == "wrong"]["why"])
    assert np.mean(rows["answer"] == "right") >= 0.5


@pytest.mark.slow
def test_a_way_that_would_rise_like_a_wall_is_no_height(foreign):
    """An almost straight way with y up was read as one that climbs 72 deg, whose slope explained its slip."""
    assert foreign.tried(51, 29)["answer"] != "wrong"


def turning_blocks(scrub):
    """Blocks of a rover that turns by this share of what its rims' difference would make without scrub."""
    random = np.random.default_rng(4)
    spins = 0.3 * np.sin(np.arange(200) / 7.0)
    turns = scrub * (spins + 0.015 * random.standard_normal(200))
    unused = np.ones((1, 200))
    return Signals(unused + 0j, unused, unused + 0j, turns[None], unused, spins[None], unused[None], unused, unused)


def test_scrub_takes_a_quarter_of_a_turn_usually():
    """Of readings that differ in the scale of the rims only, the one with three quarters of the free turn is likeliest,
    and one in which the rover turns twice as far as its rims is far off."""
    shares = np.array([0.3, 0.5, 0.6, 0.7, 0.75, 0.8, 0.9, 1.0, 1.5])
    logs = []
    for share in shares:
        blocks = turning_blocks(share)
        logs.append(float(turn_evidence(blocks.turns, blocks, np.array([False]))[0, 0]))
    assert shares[np.argmax(logs)] == 0.75
    assert logs[4] - logs[-1] > 1.5
    assert logs[4] - logs[6] > 0.1


@pytest.mark.parametrize(("share", "settled"), [(0.9, False), (0.94, False), (0.96, True), (0.98, True)])
def test_a_choice_is_settled_where_one_in_twenty_is_wrong_at_most(share, settled):
    """A silent wrong reading costs as much as twenty questions: below 19 in 20 the user is asked."""
    assert is_settled(share) is settled


def test_kept_layouts_are_of_forty_a_seed():
    table = pd.read_csv(ROOT / "studies" / "results" / "foreign_logs.csv")
    assert (table.groupby(["seed", "importer"]).size() == 40).all()
    wrong = table[(table["importer"] == "joint") & (table["answer"] == "wrong")]
    assert wrong["habits"].str.contains("gear: 53").all()


def table_of(truth, **columns):
    plain = {
        "time [s]": truth["t_s"],
        "x [m]": truth["body_x"],
        "y [m]": truth["body_y"],
        "yaw [rad]": truth["body_yaw"],
    }
    rates = {f"wheel_{name}_speed [rad/s]": truth[f"wheel_rate_{name}"] for name in WHEELS}
    return pd.DataFrame(plain | rates | columns)


def imported(table, folder, **options):
    table.to_csv(folder / "own.csv", index=False)
    imported_log = import_log([folder / "own.csv"], "cart", folder / "log", **options)
    return imported_log, read_drive_log(folder / "log")


def test_counter_of_frames_is_no_clock(tmp_path):
    """At 10 Hz it would stretch time tenfold, and rates in rad/s then pass for rpm."""
    table = table_of(recordings.truth()).drop(columns="time [s]")
    table.insert(0, "frame", np.arange(len(table)))
    with pytest.raises(DataError, match=r"'frame' counts rows.*--column t_s='frame / RATE'"):
        imported(table, tmp_path)
    _, log = imported(table, tmp_path, columns={"t_s": "frame / 10"})
    assert np.diff(log.runs[0].t) == pytest.approx(0.1)


def test_accelerometer_is_no_place_beside_latitude(tmp_path):
    truth = recordings.truth()
    table = table_of(truth, **{"e.a_X": -9.81 * truth["body_pitch"], "e.a_Y": 0.1 * truth["body_roll"]})
    lat = 48.1 + truth["body_y"] / 111_200.4
    table = table.drop(columns=["x [m]", "y [m]"]).assign(latitude=lat, longitude=11.5 + truth["body_x"] / 74_514.4)
    imported_log, _ = imported(table, tmp_path)
    assert any(line.startswith("body_x = east(latitude, longitude)") for line in imported_log.columns)


def test_wheel_is_found_between_words_only(tmp_path):
    """`rr` stands in current, and is the rear right wheel of the second rover's joints."""
    assert corner(word("current_fl").tokens)[:2] == ("front", "l")
    table = table_of(recordings.truth())
    random = np.random.default_rng(2)
    for name in WHEELS:
        table[f"e.current_{name}"] = random.normal(3.0, 1.0, len(table))
    imported_log, _ = imported(table, tmp_path)
    sources = [line.split(" = ")[1].split("  ")[0] for line in imported_log.columns if line.startswith("raw_current")]
    assert sources == [f"e.current_{name}" for name in WHEELS]


def test_rates_of_the_motors_are_asked_about_with_the_gear(tmp_path):
    table = table_of(recordings.truth())
    for name in list(table):
        table[name] = table[name] * (30.0 if name.startswith("wheel_") else 1.0)
    with pytest.raises(DataError, match=r"no rate of the wheel.*--column wheel_rate_fl=.* / GEAR"):
        imported(table, tmp_path)


def test_rims_beyond_what_a_rover_can_are_refused(tmp_path):
    """Said by the user or not: 900 m/s at the rim, and 100 times the speed over ground."""
    table = table_of(recordings.truth()).rename(columns=lambda name: name.replace(" [rad/s]", ""))
    columns = {f"wheel_rate_{name}": f"100 * wheel_{name}_speed" for name in WHEELS}
    with pytest.raises(DataError, match=r"do not agree|--column"):
        imported(table, tmp_path, columns=columns)


def test_places_that_do_not_move_with_the_wheels_are_asked_about(tmp_path):
    table = table_of(recordings.truth())
    truth = recordings.truth(seed=8)
    table["x [m]"], table["y [m]"] = truth["body_y"][::-1] * 3.0, np.random.default_rng(1).normal(0, 1, len(table))
    with pytest.raises(DataError, match=r"--column"):
        imported(table, tmp_path)


def test_north_east_down_is_seen_by_the_wheels(tmp_path):
    """In a mirror heading and track agree; that the right wheels run faster to the left tells it."""
    truth = recordings.truth()
    table = table_of(truth, **{"z [m]": -truth["body_z"]})
    table["y [m]"], table["yaw [rad]"] = -table["y [m]"], -table["yaw [rad]"]
    _, log = imported(table, tmp_path)
    run = log.runs[0]
    turned = np.corrcoef(np.gradient(run["body_yaw"]), run["wheel_rate_fr"] - run["wheel_rate_fl"])[0, 1]
    assert turned > 0.5
    assert np.polyfit(truth["body_z"][: len(run.t) + 40], -table["z [m]"][: len(run.t) + 40], 1)[0] == pytest.approx(
        1.0
    )
    assert np.ptp(run["body_z"]) > 0.0


@pytest.mark.parametrize("first", ["real", "imaginary"])
def test_quaternion_of_either_order(first, tmp_path):
    truth = recordings.truth()
    x, y, z, w = recordings.quaternion(truth)
    order = (w, x, y, z) if first == "real" else (x, y, z, w)
    table = (
        table_of(truth).drop(columns="yaw [rad]").assign(**{f"q{at}": component for at, component in enumerate(order)})
    )
    _, log = imported(table, tmp_path)
    begin = round(10 * float(log.runs[0].attrs["purpose"].split(" from ")[1].split()[0]))
    off = log.runs[0]["body_yaw"] - truth["body_yaw"][begin : begin + len(log.runs[0].t)]
    assert np.abs(np.angle(np.exp(1j * off))).max() < 0.1


def test_bad_file_among_several_is_left_out_and_named(tmp_path):
    """A straight drive does not show the convention, and one file stands still: all files together show both."""
    truth = recordings.truth(seconds=120.0)
    table = table_of(truth)
    for number, rows in enumerate(np.array_split(np.arange(len(table)), 3)):
        part = table.iloc[rows]
        if number == 1:
            part = part.assign(**{name: part[name].iloc[0] for name in part if not name.startswith("time")})
        part.to_csv(tmp_path / f"leg{number}.csv", index=False)
    imported_log = import_log([tmp_path / f"leg{at}.csv" for at in range(3)], "cart", tmp_path / "log")
    assert any(note.startswith("leg1.csv: left out") for note in imported_log.notes)
    assert {line.split("-")[0] for line in imported_log.runs} == {"leg0", "leg2"}


@pytest.mark.parametrize("marks", ["____ _".replace(" ", ""), "::: ", "-- T"])
def test_date_with_any_marks_is_the_clock(marks, tmp_path):
    stamps = pd.Timestamp("2024-04-23 13:29:22.226") + pd.to_timedelta(np.arange(5) * 0.25, unit="s")
    form = {"_____": "%Y_%m_%d_%H_%M_%S_", "::: ": "%Y:%m:%d %H:%M:%S.", "-- T": "%Y-%m-%dT%H:%M:%S."}[marks]
    texts = [stamp.strftime(form) + f"{stamp.microsecond // 1000:03d}" for stamp in stamps]
    pd.DataFrame({"timestamp": texts, "x": np.arange(5.0)}).to_csv(tmp_path / "a.csv", index=False)
    assert np.diff(read_raw(tmp_path / "a.csv").table["timestamp"]) == pytest.approx(0.25e9)


def test_records_one_a_row_are_a_table(tmp_path):
    from scipy.io import savemat

    rows = np.empty((30, 1), dtype=[("t", object), ("x", object), ("mode", object)])
    for at in range(30):
        rows[at, 0] = (0.1 * at, 2.0 * at, "auto")
    savemat(tmp_path / "a.mat", {"log": rows})
    table = read_raw(tmp_path / "a.mat").table
    assert table["log.x"].to_numpy() == pytest.approx(2.0 * np.arange(30.0))
    assert sorted(table) == ["log.t", "log.x"]


def test_track_scale_and_late_clock_are_measured_with_intervals(tmp_path):
    """A track 1.5 times that of the wheels, and wheels that were recorded 0.4 s late."""
    truth = recordings.truth(seconds=150.0)
    table = table_of(truth)
    rates = [table[f"wheel_{name}_speed [rad/s]"].to_numpy() for name in WHEELS]
    turn = np.gradient(truth["body_yaw"], truth["t_s"])
    smooth = np.convolve(turn, np.ones(9) / 9.0, "same")
    for name, rate, side in zip(WHEELS, rates, (-1, 1, -1, 1), strict=True):
        wider = rate + side * 0.5 * recordings.HALF * smooth / recordings.R
        table[f"wheel_{name}_speed [rad/s]"] = np.interp(truth["t_s"] - 0.4, truth["t_s"], wider)
    imported_log, _ = imported(table, tmp_path)
    (track,) = [note for note in imported_log.notes if note.startswith("effective track")]
    best, low, high = (float(word) for word in track.split(" m,")[0].removeprefix("effective track ").replace("[", "")
                       .replace("]", "").replace(",", "").split())  # fmt: skip
    assert low < 1.5 * 2.0 * recordings.HALF < high
    assert high - low < 0.4 * best
    (late,) = [note for note in imported_log.notes if "times are" in note]
    assert float(late.split("times are ")[1].split(" s")[0]) == pytest.approx(0.4, abs=0.08)
    assert any(note.startswith("rims run 1.") for note in imported_log.notes)


def test_angles_without_a_unit_are_known_by_the_climb(tmp_path):
    truth = recordings.truth()
    table = table_of(truth, **{"z [m]": truth["body_z"], "pitch": -truth["body_pitch"] * 180.0 / math.pi})
    imported_log, log = imported(table, tmp_path)
    assert np.abs(log.runs[0]["body_pitch"]).max() < 0.2
    assert any(line.startswith("body_pitch = -pitch [deg]") for line in imported_log.columns)


def test_a_pitch_by_its_own_name_is_taken_unless_the_climb_contradicts_it(tmp_path):
    """On level ground, where a pitch is noise, the name decides; where the rover climbs, the climb does."""
    seen = recordings.truth()
    noise = np.random.default_rng(8).normal(0.0, 0.01, (5, len(seen["t_s"])))
    for number, pitch in enumerate([seen["body_pitch"], *noise]):
        folder = tmp_path / str(number)
        folder.mkdir()
        made, _ = imported(table_of(seen, body_pitch=pitch), folder)
        assert any(line.startswith("body_pitch = body_pitch") for line in made.columns)
    folder = tmp_path / "reversed"
    folder.mkdir()
    made, log = imported(table_of(seen, **{"z [m]": seen["body_z"], "body_pitch": -seen["body_pitch"]}), folder)
    assert not any(line.startswith("body_pitch =") for line in made.columns)
    assert "body_pitch" not in log.runs[0]


def test_a_column_that_begins_like_a_channel_is_read_as_the_importer_says(tmp_path):
    """The reader of a log takes columns by the names of channels: one in degrees was taken for radians."""
    trace = scenario("field", duration=25.0).drive()
    table = pd.DataFrame({"time [s]": trace.t, "x [m]": trace["body_x"], "y [m]": trace["body_y"]})
    for wheel in ("fl", "fr", "ml", "mr", "rl", "rr"):
        table[f"wheel_{wheel}_speed [rad/s]"] = trace[f"wheel_rate_{wheel}"]
    table["yaw [rad]"], table["bogie_l_deg"] = trace["body_yaw"], np.degrees(trace["bogie_l"])
    table["rocker_box_raw"], table["battery_V"] = 40.0 * trace["rocker_l"], 7.2
    table[::10].to_csv(tmp_path / "own.csv", index=False)
    place = {name: f'col("{name[-1]} [m]")' for name in ("body_x", "body_y")}
    made = import_log([tmp_path / "own.csv"], "nexus6", tmp_path / "log", columns=place)
    runs = read_drive_log(tmp_path / "log").runs
    bogie = max(np.abs(run["bogie_l"]).max() for run in runs)
    assert bogie == pytest.approx(np.abs(trace["bogie_l"]).max(), rel=0.05)
    assert all(run["battery_V"][0] == pytest.approx(7.2) for run in runs)
    assert not {"bogie_l_deg", "recorded bogie_l_deg", "rocker_box_raw"} & set(runs[0].channels)
    (unused,) = (note for note in made.notes if "not used" in note)
    assert "rocker_box_raw" in unused
    assert "battery_V" not in unused


@pytest.mark.parametrize("frame", [1.0, -1.0])
@pytest.mark.parametrize(
    ("gyro", "accelerometer", "per_rate", "per_force"),
    [
        ("gyro_{}", "acc_{}", 180.0 / math.pi, 1.0 / 9.80665),
        ("imu.angular_velocity.{}", "imu.linear_acceleration.{}", 1.0, 1.0),
        ("Gyro{} [deg/s]", "Acc{} [m/s^2]", 180.0 / math.pi, 1.0),
    ],
)
def test_an_inertial_unit_is_read_in_its_units_and_axes(tmp_path, gyro, accelerometer, per_rate, per_force, frame):
    """Axes ahead, left and up, or ahead, right and down."""
    true_drive, random = recordings.truth(), np.random.default_rng(2)
    turn = np.gradient(true_drive["body_yaw"], true_drive["t_s"])
    rates = {"x": 0.0 * turn, "y": 0.0 * turn, "z": turn}
    forces = {
        "x": -9.81 * np.sin(true_drive["body_pitch"]),
        "y": 0.0 * turn,
        "z": 9.81 * np.cos(true_drive["body_pitch"]),
    }
    columns, truth = {}, {}
    for name, kind, values, per, sd in (
        (gyro, "gyro", rates, per_rate, 0.01),
        (accelerometer, "accelerometer", forces, per_force, 0.1),
    ):
        for axis, sign in zip("xyz", (1.0, frame, frame), strict=True):
            truth[f"{kind}_{axis}"] = values[axis] + sd * random.standard_normal(len(turn))
            columns[name.format(axis)] = sign * per * truth[f"{kind}_{axis}"]
    path = tmp_path / "imu.csv"
    table_of(true_drive, **columns).to_csv(path, index=False)
    import_log([path], "cart", tmp_path / "log")
    for run in read_drive_log(tmp_path / "log").runs:
        begin = int(np.argmin(np.abs(true_drive["body_x"] - run["body_x"][0])))
        for name, values in truth.items():
            assert run[name] == pytest.approx(values[begin : begin + len(run.t)], rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize("unit", ["s", "us"])
def test_dates_that_nanoseconds_cannot_count_are_left_out(tmp_path, unit):
    """The year 1 ended with a traceback of pandas."""
    times = np.array(["0001-01-01T00:00:00", "0001-01-01T00:00:01", "0001-01-01T00:00:02"], dtype=f"datetime64[{unit}]")
    table = pyarrow.table({"stamp": pyarrow.array(times), "a": [1.0, 2.0, 3.0], "b": [0.0, 1.0, 0.5]})
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    raw = read_raw(tmp_path / "a.parquet")
    assert list(raw.table) == ["a", "b"]
    assert any("stamp" in note for note in raw.notes)


def test_objects_of_matlab_are_named_and_the_numbers_beside_them_read(tmp_path):
    """A datetime has no dimensions: its matrix was taken apart at the wrong places, and the whole file refused."""

    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    savemat(tmp_path / "a.mat", {"t": np.arange(5.0), "imu": {"pitch": np.arange(5.0)}})
    names = b"".join(element(1, name) for name in (b"stamp", b"MCOS", b"datetime"))
    opaque = element(6, struct.pack("<II", 17, 0)) + names
    head = element(6, struct.pack("<II", 9, 0)) + element(5, struct.pack("<2i", 5, 1))
    nameless = head + element(1, b"") + element(2, b"12345")
    content = (tmp_path / "a.mat").read_bytes()
    (tmp_path / "a.mat").write_bytes(content + element(14, opaque) + element(14, nameless))
    raw = read_raw(tmp_path / "a.mat")
    assert sorted(raw.table) == ["imu.pitch", "t"]
    assert any("'stamp' (datetime)" in note for note in raw.notes)
