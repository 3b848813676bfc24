"""Column names and layouts of several laboratories: each table contains equal runs, and must be read as these runs."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Wheel
from rover_pin.measurements.foreign_rig import RigTable
from rover_pin.measurements.rig_columns import matches

SLIP = np.array([0.0, 0.1, 0.3, 0.6])
LOAD = np.array([80.0, 80.0, 79.0, 81.0])
PULL = np.array([-2.5, 4.25, 12.5, 17.0])
TORQUE = np.array([1.5, 2.25, 3.5, 4.0])
SINKAGE = np.array([0.008, 0.0105, 0.016, 0.0225])
G = 9.81

S, W, F, T, Z = "slip", "load_N", "drawbar_pull_N", "torque_Nm", "sinkage_m"
TRUTH = {S: SLIP, W: LOAD, F: PULL, T: TORQUE, Z: SINKAGE}


def text(header, factors, delimiter=",", comma=False, lines=()):
    """Return a table with the given column names, whose SI values are multiplied by the given factors."""
    values = [TRUTH[name] * factor for name, factor in factors]
    rows = [delimiter.join(f"{value:.10g}" for value in row) for row in zip(*values, strict=True)]
    rows = [row.replace(".", ",") for row in rows] if comma else rows
    return "\n".join([*lines, header, *rows]) + "\n"


ALL = ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1))
MILLI = ((S, 100), (W, 1), (F, 1), (T, 1), (Z, 1000))
TABLES = {
    "a paper's words": text("Slip ratio,Normal force (N),Drawbar pull (N),Wheel torque (Nm),Sinkage (mm)",
                            ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1000))),
    "wheel load and D.P.": text("slip (%),Wheel load,D.P.,Drive torque,\"Sinkage, z (mm)\"", MILLI),
    "net traction": text("Slip [%];Vertical Load [N];Net traction [N];Driving Torque [N·m];Sinkage [mm]", MILLI, ";"),
    "symbols": text("i,W (N),DP (N),T (Nm),z (mm)", ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1000))),
    "force transducer": text("s [-]\tFz [N]\tFx [N]\tMy [Nm]\th [m]", ALL, "\t"),
    "underscored symbols": text("S,F_z_N,F_x_N,M_y_Nm,z_mm", ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1000))),
    "camel case": text("slipRatio,normalLoad,drawbarPull,wheelTorque,wheelSinkage", ALL),
    "braces": text("slip {%},load {N},pull {N},torque {Nm},sinkage {mm}", MILLI),
    "corner brackets": text("slip 【%】,load 【N】,pull 【N】,torque 【Nm】,sinkage 【mm】", MILLI),
    "full width": text("slip（％）,load（N）,pull（N）,torque（Nm）,sinkage（mm）", MILLI),
    "angle brackets": text("slip <%>,load <N>,pull <N>,torque <Nm>,sinkage <mm>", MILLI),
    "slashes of DIN": text("Schlupf / %;Radlast / N;Zugkraft / N;Drehmoment / Nm;Einsinkung / mm", MILLI, ";", True),
    "German words and commas": text(
        "Schlupf in Prozent;Normalkraft in kN;Nettozugkraft in N;Antriebsmoment in Nm;Einsinktiefe in cm",
        ((S, 100), (W, 1e-3), (F, 1), (T, 1), (Z, 100)), ";", True),
    "German means": text("mittlerer Schlupf [%];Vertikalkraft (gemittelt) [N];Zugkraft Mittelwert [N];Radmoment [Nm];"
                         "Einsinkung gemessen [mm]", MILLI, ";", True),
    "French": text("Taux de glissement (%);Charge verticale (N);Force de traction (N);Couple (N.m);Enfoncement (mm)",
                   MILLI, ";", True),
    "French with apostrophe": text("Glissement;Force normale [N];Effort de traction [N];Couple d'entraînement [Nm];"
                                   "Profondeur d'enfoncement [mm]", ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1e3)), ";"),
    "Spanish": text("deslizamiento (%),carga vertical (N),fuerza de tracción (N),par motor (Nm),hundimiento (mm)",
                    MILLI),
    "Japanese": text("すべり率 [%],垂直荷重 [N],けん引力 [N],駆動トルク [Nm],沈下量 [mm]", MILLI),
    "Japanese, bare fraction": text("スリップ率,荷重(N),牽引力(N),トルク(N・m),沈下量(cm)",
                                    ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 100))),
    "load in kg": text("slip,Load (kg),DP (N),torque (Nm),sinkage (mm)",
                       ((S, 1), (W, 1 / G), (F, 1), (T, 1), (Z, 1e3))),
    "mass on the wheel": text("slip,Wheel mass [kg],Pull [N],Torque [Nm],Sinkage [m]",
                              ((S, 1), (W, 1 / G), (F, 1), (T, 1), (Z, 1))),
    "kilopond": text("slip,load (kgf),pull (kgf),torque (kgf cm),sinkage (cm)",
                     ((S, 1), (W, 1 / 9.80665), (F, 1 / 9.80665), (T, 100 / 9.80665), (Z, 100))),
    "pounds and inches": text("Slip %,Vertical load lbf,Drawbar lbf,Torque ft-lbf,Sinkage in",
                              ((S, 100), (W, 1 / 4.4482216152605), (F, 1 / 4.4482216152605),
                               (T, 1 / (0.3048 * 4.4482216152605)), (Z, 1 / 0.0254))),
    "row of units": text("Slip,Load,Drawbar pull,Torque,Sinkage\n%,N,N,Nm,mm", MILLI),
    "row of units in brackets": text("Slip;Load;DP;Torque;Sinkage\n(%);(N);(N);(Nm);(mm)", MILLI, ";", True),
    "comments before": text("slip,load_N,drawbar_pull_N,torque_Nm,sinkage_m", ALL,
                            lines=("# single wheel test bed", "# operator: N.N.", "# 2024-05-17, dry sand")),
    "commented header": text("# slip [%] ; load [N] ; pull [N] ; torque [Nm] ; sinkage [mm]", MILLI, " ; "),
    "title and blank line": text("Slip (%),Load (N),DP (N),Torque (Nm),Sinkage (mm)", MILLI,
                                 lines=("Test series 3,,,,", ",,,,")),
    "quoted decimal commas": "slip,load,pull,torque,sinkage\n" + "\n".join(
        ",".join(f'"{value:.10g}"'.replace(".", ",") for value in row)
        for row in zip(SLIP, LOAD, PULL, TORQUE, SINKAGE, strict=True)) + "\n",
    "measured and commanded": "slip set (%),slip measured (%),load target (N),load (N),pull (N),torque (Nm),"
                              "sinkage (mm)\n" + "\n".join(
        f"{round(100 * s, -1)},{100 * s},80,{w},{f},{t},{1e3 * z}"
        for s, w, f, t, z in zip(SLIP, LOAD, PULL, TORQUE, SINKAGE, strict=True)) + "\n",
    "times and temperatures beside": "t_s,T (°C),slip,load_N,pull_N,T (Nm),sinkage_m,max sinkage (mm)\n" + "\n".join(
        f"{10 * at},21.5,{s},{w},{f},{t},{z},{1e3 * z + 3}"
        for at, (s, w, f, t, z) in enumerate(zip(SLIP, LOAD, PULL, TORQUE, SINKAGE, strict=True))) + "\n",
    "averages of a spreadsheet": text("Avg slip (%),Average normal load (N),Avg. drawbar pull (N),Mean torque (Nm),"
                                      "Mean wheel sinkage (mm)", MILLI),
    "symbols behind words": text("Slip ratio s (-),\"Vertical load, W (N)\",Drawbar pull DP (N),Torque T (Nm),"
                                 "\"Sinkage, h (mm)\"", ((S, 1), (W, 1), (F, 1), (T, 1), (Z, 1e3))),
    "names in brackets": text("Slip (s),Load (W),Drawbar pull (DP),Torque (T),Sinkage (z)", ALL),
    "header on every page": "\n".join([(page := "slip,load_N,drawbar_pull_N,torque_Nm,sinkage_m"), *(
        line for at, row in enumerate(zip(SLIP, LOAD, PULL, TORQUE, SINKAGE, strict=True))
        for line in (*([page] if at == 2 else []), ",".join(map(str, row))))]) + "\n",
    "two sheets in one export": "\n".join(["Sheet1", (page := "slip;load [N];pull [N];torque [Nm];sinkage [mm]"), *(
        line for at, (s, w, f, t, z) in enumerate(zip(SLIP, LOAD, PULL, TORQUE, SINKAGE, strict=True))
        for line in (*(["", "Sheet2;;;;", page] if at == 2 else []), f"{s};{w};{f};{t};{1e3 * z}"))]) + "\n",
    "words that nobody listed": text("slip of run (%),load on rig (N),drawbar pull dynamometer (N),torque at hub (Nm),"
                                     "sinkage laser (mm)", MILLI),
}  # fmt: skip


@pytest.mark.parametrize("layout", TABLES)
def test_a_laboratorys_table_is_read_in_si(layout, tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text(TABLES[layout], encoding="utf-8")
    points = RigTable(path).points(Wheel(0.1, 0.05))
    load = points["load_N"] if "load_N" in points else G * points["load_kg"]
    for name, truth in TRUTH.items():
        np.testing.assert_allclose(load if name == W else points[name], truth, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_other_encodings_are_read(encoding, tmp_path):
    path = tmp_path / "runs.csv"
    path.write_bytes(TABLES["French with apostrophe"].encode(encoding))
    np.testing.assert_allclose(RigTable(path).points(Wheel(0.1, 0.05))[T], TORQUE)


@pytest.mark.parametrize(
    "header",
    ["t_s", "t (s)", "Time [s]", "T (°C)", "Temp (C)", "T_soil [°C]", "i (A)", "Motor current (A)", "max sinkage (mm)",
     "Peak torque (Nm)", "Motor torque (mNm)", "slip rate (1/s)", "Traction coefficient", "DP/W", "w (%)", "h (s)",
     "Moisture (%)", "v (V)", "rut depth (mm)", "operator", "date", "Sinkage rate (mm/s)", "Rolling resistance (N)",
     "Gross traction (N)", "torque error (Nm)", "load cell offset (N)", "S (A)"],
)  # fmt: skip
def test_other_quantities_are_left_alone(header):
    assert matches(header) == ()


@pytest.mark.parametrize(
    ("header", "column"),
    [
        ("Slip angle (deg)", "slip_angle_rad"),
        ("β [°]", "slip_angle_rad"),
        ("Schräglaufwinkel [Grad]", "slip_angle_rad"),
        ("Side force (N)", "lateral_N"),
        ("Seitenkraft [N]", "lateral_N"),
        ("Fy (N)", "lateral_N"),
        ("Mz [Nm]", "moment_z_Nm"),
        ("Carriage velocity (mm/s)", "travel_speed_mps"),
        ("v [cm/s]", "travel_speed_mps"),
        ("Fahrgeschwindigkeit in mm/s", "travel_speed_mps"),
        ("Wheel speed (m/s)", "rim_speed_mps"),
        ("Wheel speed (rpm)", "wheel_rate_radps"),
        ("ω (rad/s)", "wheel_rate_radps"),
        ("Raddrehzahl [U/min]", "wheel_rate_radps"),
        ("周速度 [mm/s]", "rim_speed_mps"),
        ("Slope (°)", "slope_rad"),
        ("Std. dev. of drawbar pull (N)", "drawbar_pull_sd_N"),
        ("Sinkage SD (mm)", "sinkage_sd_m"),
        ("Standardabweichung Drehmoment [Nm]", "torque_sd_Nm"),
        ("Écart-type couple (Nm)", "torque_sd_Nm"),
        ("Test No.", "run"),
        ("Versuch Nr.", "run"),
    ],
)
def test_other_columns_of_a_set_are_known(header, column):
    assert matches(header)[0].column == column


def test_slip_follows_from_speeds_where_no_column_has_it(tmp_path):
    rim, r = 0.05, 0.1
    lines = [
        f"{60 * rim / r / (2 * math.pi):.9g},{1e3 * rim * (1 - slip):.9g},{load},{pull}"
        for slip, load, pull in zip(SLIP, LOAD, PULL, strict=True)
    ]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(["wheel speed (rpm),carriage speed (mm/s),load (N),pull (N)", *lines]))
    points = RigTable(path).points(Wheel(r, 0.05))
    np.testing.assert_allclose(points["slip"], SLIP, atol=1e-8)
    np.testing.assert_allclose(points["rim_speed_mps"], rim, rtol=1e-8)


def refused(tmp_path, content, **formulas):
    path = tmp_path / "runs.csv"
    path.write_text(content)
    table = RigTable(path, formulas)
    with pytest.raises(DataError) as refusal:
        table.points(Wheel(0.1, 0.05))
    return table, str(refusal.value)


def test_a_decimal_comma_in_one_cell_has_its_line_although_others_are_empty(tmp_path):
    rows = [f"0.{at};80;{1 + at};" + ("" if at == 5 else f"0.0{at + 1}") for at in range(10)]
    rows[8] = "0.8;80;1,25;0.02"
    table, sentence = refused(tmp_path, "\n".join(["slip;load_N;drawbar_pull_N;sinkage_m", *rows]))
    assert "line 10" in sentence
    assert "'1,25'" in sentence
    assert "1.25" in sentence
    assert any("'slip' is slip" in note for note in table.notes)


def test_two_columns_of_one_quantity_are_a_question_that_a_formula_answers(tmp_path):
    content = "slip,load_N,sinkage 1 (mm),sinkage 2 (mm)\n" + "".join(
        f"0.{at},80,{at + 4},{at + 6}\n" for at in range(4)
    )
    _, sentence = refused(tmp_path, content)
    assert "--column sinkage_m=" in sentence
    formula = "(col('sinkage 1 (mm)') + col('sinkage 2 (mm)')) / 2000"
    points = RigTable(tmp_path / "runs.csv", {"sinkage_m": formula}).points(Wheel(0.1, 0.05))
    np.testing.assert_allclose(points["sinkage_m"], [0.005, 0.006, 0.007, 0.008])


def test_a_column_or_a_constant_is_named_by_the_user(tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text("slip,Kanal 3 [kN],Kanal 4\n0.1,0.002,9\n0.3,0.004,9\n")
    table = RigTable(path, {"drawbar_pull_N": "Kanal 3 [kN]", "load_N": "50"})
    points = table.points(Wheel(0.1, 0.05))
    assert points["drawbar_pull_N"].tolist() == [2.0, 4.0]
    assert points["load_N"].tolist() == [50.0, 50.0]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("slip,load_N,drawbar_pull_N\n0,50,1\n45,50,9\n", ("45", "slip (%)", "/ 100")),
        ("slip (%),load_N,drawbar_pull_N\n0,50,1\n250,50,9\n", ("2.5", "over-travel-speed")),
        ("slip (%),load_N,drawbar_pull_N\n0,50,1\n-250,50,9\n", ("-2.5", "over-rim-speed")),
        ("slip,pull\n0.1,5\n", ("load_N", "--column load_N=50")),
        ("slip,load\n0.1,5\n", ("drawbar_pull_N", "torque_Nm", "sinkage_m")),
        ("slip,load (N),torque (mm)\n0.1,5,1\n", ("torque_Nm",)),
        ("slip,load_N,sinkage_m\n0.1,50,12\n", ("'sinkage_m'", "row 1", "millimetres")),
    ],
)
def test_a_table_that_is_no_set_is_refused_with_a_remedy(content, words, tmp_path):
    _, sentence = refused(tmp_path, content)
    for word in words:
        assert word in sentence
