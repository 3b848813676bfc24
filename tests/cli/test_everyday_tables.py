"""One table in the many ways that programs write it: `init` and `import-log` read it, or say where it is wrong."""

import gzip
import json
import re
from pathlib import Path

import pytest

from tests.importing import recordings

HEAD = "slip,load_N,drawbar_pull_N,torque_Nm"
ROWS = ("0.1,80,10.5,3", "0.2,80,14.5,3.5", "0.3,79,17.25,4", "0.5,81,20,4.5")
PLAIN = "\n".join([HEAD, *ROWS])
INIT = ("--r", "60mm", "--b", "50mm", "--noise", "drawbar_pull=1N", "--noise", "torque=0.1Nm", "--json")
HABITS = {
    "as it is": PLAIN,
    "semicolons": PLAIN.replace(",", ";"),
    "decimal comma": PLAIN.replace(",", ";").replace(".", ","),
    "tabs and decimal comma": PLAIN.replace(",", "\t").replace(".", ","),
    "byte-order mark": "\ufeff" + PLAIN,
    "lines before": "Rig 3\nmeasured by us, in 2026\n\n" + PLAIN,
    "row of units": "\n".join([HEAD, "-,N,N,Nm", *ROWS]),
    "row of units in brackets": "\n".join(["Slip,Load,Drawbar pull,Torque", "[-],[N],[N],[N m]", *ROWS]),
    "row of units and words": "\n".join(["Slip,Load,DP,Torque,Who", "-,N,N,Nm,name", *(f"{row},Max" for row in ROWS)]),
    "units in cells": "\n".join(["slip,load,drawbar pull,torque"] + [f"{row} Nm" for row in ROWS]),
    "unit in some cells": PLAIN.replace("81", "81 N"),
    "other units in cells": re.sub(r",(79|80|81),", lambda expected: f",{float(expected[1]) / 1e3} kN,", PLAIN),
    "empty rows behind": PLAIN + "\n,,,\n,,,\n",
    "delimiters at the ends": PLAIN.replace(",", ";").replace("\n", ";\n") + ";",
    "a delimiter behind the names": PLAIN.replace("torque_Nm", "torque_Nm,"),
    "delimiters behind the rows": PLAIN.replace("\n", ";\n").replace(",", ";").replace("Nm;", "Nm") + ";",
    "a last column that is empty": "\n".join([f"{HEAD},note", *(f"{row}," for row in ROWS)]),
    "quotes": PLAIN.replace("slip", '"slip"').replace("0.2,80", '"0.2","80"'),
}  # fmt: skip


@pytest.mark.parametrize("habit", HABITS)
def test_init_reads_one_table_in_every_habit(habit, run):
    Path("runs.csv").write_text(HABITS[habit], encoding="utf-8")
    code, _, err = run("init", "runs.csv", *INIT)
    assert (code, err) == (0, "")
    lines = [line.split(",") for line in Path("runs/points.csv").read_text().splitlines()]
    assert lines[0] == HEAD.split(",")
    assert [[float(cell) for cell in row] for row in lines[1:]] == [[float(c) for c in row.split(",")] for row in ROWS]
    assert run("check-data", "runs")[0] == 0


def test_rigs_logs_and_terrains_are_read_alike(run):
    from rover_pin.demo import rig

    rig.write(Path("set"), "nothing", 0)
    text = Path("set/points.csv").read_text()
    holds = json.loads(run("check-data", "set", "--json")[1])["holds"]
    Path("set/points.csv").write_text("Our rig\n\n" + text.replace(",", ";").replace(".", ","))
    assert json.loads(run("check-data", "set", "--json")[1])["holds"] == holds
    Path("ground.csv").write_text("x_m;z_m\n[m];[m]\n-1,0;0,0\n0,5;0,0\n2,0;0,25\n")
    set_ground = ("--set", "terrain.path=ground.csv", "--set", "duration=0.1", "--out", "out")
    assert run("drive", "polyline", *set_ground)[0] == 0
    log = Path("out/log/polyline.csv")
    log = log if log.is_file() else next(Path("out/log").glob("*.csv"))
    log.write_text(log.read_text().replace(",", "\t").replace(".", ","))
    assert run("export", "out/log", "--to", "csv")[0] == 0


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (PLAIN.replace("14.5", "much"), "line 3: column 'drawbar_pull_N' has 'much'"),
        (PLAIN.replace("81", "8.1 kg"), "line 5: column 'load_N' has '8.1 kg'"),
        (PLAIN.replace("80", "-", 1), "row 1"),
        (PLAIN + "\n0.6,80", "line 6: 2 cells under 4 column names"),
        (PLAIN.replace("torque_Nm", "slip"), "line 1: "),
        (HEAD, "file"),
    ],
)
def test_what_init_cannot_read_has_its_place(text, place, run):
    Path("runs.csv").write_text(text)
    code, _, err = run("init", "runs.csv", *INIT)
    assert code == 2
    assert place in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("command", [("init", *INIT), ("import-log", "--rover", "cart")])
@pytest.mark.parametrize(
    "begin", [b"PK\x03\x04\x14\x00", b"\xd0\xcf\x11\xe0\xa1\xb1", gzip.compress(b"slip\n1\n", mtime=0)]
)
def test_a_spreadsheet_is_refused_with_what_to_do(command, begin, run):
    Path("runs.xlsx").write_bytes(begin + bytes(200))
    code, _, err = run(command[0], "runs.xlsx", *command[1:])
    assert code == 2
    assert "spreadsheet" in err
    assert "CSV" in err


def stamps(**columns):
    """A drive whose time stands in these columns."""
    import pandas as pd

    truth = recordings.truth()
    ns = recordings.EPOCH + (1e9 * truth.pop("t_s")).round().astype(int)
    table = {name: column(ns) for name, column in columns.items()}
    pd.DataFrame(table | truth).to_csv("drive.csv", index=False)


def test_whole_seconds_and_nanoseconds_are_one_clock(run):
    stamps(**{"header.stamp.sec": lambda ns: ns // 10**9, "header.stamp.nanosec": lambda ns: ns % 10**9})
    code, out, err = run("import-log", "drive.csv", "--rover", "cart", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert any("clock 'header.stamp [s]'" in note for note in report["notes"]), report["notes"]
    stored = [float(line.split(": ")[1].split(" s from")[0]) for line in report["runs"]]
    assert sum(stored) > 55.0, "of 70 s with a stop of 6 s"


@pytest.mark.parametrize("names", ["\u65f6\u95f4,\u4f4d\u7f6e,\u901f\u5ea6", "---,+++,***", "1,2,3", ",,"])
def test_names_without_a_latin_letter_are_named_and_refused(names, run):
    rows = "".join(f"{0.1 * at:.1f},{0.01 * at:.2f},{0.2 + 0.001 * (at % 3):.3f}\n" for at in range(200))
    Path("drive.csv").write_text(f"{names}\n{rows}", encoding="utf-8")
    code, _, err = run("import-log", "drive.csv", "--rover", "cart")
    assert code == 2
    assert "column" in err
    assert err.count("\n") == 1


def test_other_scripts_go_with_columns_that_are_said(run):
    import pandas as pd

    truth = recordings.truth()
    names = {"t_s": "\u65f6\u95f4", "body_x": "\u4f4d\u7f6e x"}
    pd.DataFrame({names.get(name, name): values for name, values in truth.items()}).to_csv("drive.csv", index=False)
    assert run("import-log", "drive.csv", "--rover", "cart", "--column", "body_x=\u4f4d\u7f6e x")[0] == 0
    assert run("check-data", "drive")[0] == 0


def test_rows_cut_short_and_words_in_cells_are_said(run):
    path = recordings.plain(recordings.truth(), Path())
    lines = path.read_text().splitlines()
    lines[100] = ",".join(["x" if at == 3 else cell for at, cell in enumerate(lines[100].split(","))])
    path.write_text("\n".join([*lines, "70.1,0.2"]))
    code, out, _ = run("import-log", "plain.csv", "--rover", "cart", "--json")
    assert code == 0
    notes = json.loads(out)["notes"]
    assert any(re.search(r"line 702: 2 .* 11 ", note) for note in notes)
    assert any("1 cells of 'z [m]'" in note for note in notes)
