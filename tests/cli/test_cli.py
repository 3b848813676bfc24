"""Every command: what it prints and writes, and one clear sentence with a non-zero exit for what it refuses."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin.logs.drive_log import load_trace

ROOT = Path(__file__).parents[2]
RIG = ROOT / "studies" / "data" / "cmu-smooth-wheel"
SWEEP = """
name = "three"
scenario = "flat"
duration = 1.0
plan = { kind = "grid", points = 3 }
[parameters]
soil.k = { low = 10, high = 50, unit = "mm" }
"""
TUNE = """
name = "tiny"
free = { k_p = [0.01, 10.0] }
effort = { population = 5, generations = 0, starts = 0, keep = 1 }
[[training]]
name = "flat"
scenario = "flat"
duration = 2
"""


def strict(text):
    """Parse JSON as machines do: NaN and Infinity are no JSON."""
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def said(run, *words):
    code, out, _ = run(*words, "--json")
    assert code == 0
    return strict(out)


def test_drive_writes_a_log_and_figures(run):
    output = said(run, "drive", "ditch", "--set", "duration=2", "--out", "here")
    assert output["stop"] == "duration"
    assert output["end_time_s"] == pytest.approx(2.0)
    assert 0.05 < output["distance_m"] < 0.15
    assert output["files"] == ["here/log", "here/snapshots.png", "here/history.png"]
    assert all(Path(file).exists() for file in output["files"])
    trace = load_trace("here/log")
    assert trace["body_x"][-1] == output["end_x_m"]
    assert Path("here/snapshots.png").read_bytes().startswith(b"\x89PNG")


def test_drive_takes_control_gravity_soil_and_settings(run):
    output = said(
        run, "drive", "flat", "--control", "true", "--gravity", "moon", "--soil", "fjs-1", "--set", "duration=1"
    )
    attrs = load_trace("out/drive/log").attrs
    assert (attrs["control"], attrs["gravity_mps2"]) == ("SlipControl", 1.62)
    assert output["scenario"] == "flat"


def test_drive_takes_an_engine(run):
    """Only the trace of another engine than the default names it."""
    ends = []
    for words in ((), ("--engine", "pinocchio-aba")):
        told = said(run, "drive", "turn", "--set", "duration=0.2", *words)
        assert told.get("engine", "") == load_trace("out/drive/log").attrs.get("engine", "") == "".join(words[1:])
        ends.append(told["end_x_m"])
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)


def test_drive_says_the_error_of_its_step(run):
    output = said(run, "drive", "flat", "--set", "duration=2")
    assert 0.0 < output["step_error_mm"] < 0.1


def test_a_drive_that_ends_early_still_leaves_its_trace(run):
    output = said(run, "drive", "flat", "--set", "soil.k_1=8000")
    assert output["stop"].startswith("buried: wheel")
    assert len(load_trace("out/drive/log").t) >= 1


def test_curve_gives_every_form(run):
    output = said(run, "curve", "--k", "0.01", "--k", "0.05")
    assert output["F(net, k = 50 mm)"]["S=1"] == pytest.approx(0.0012, abs=1e-4)
    assert output["F(torque, k = 50 mm)"]["S=1"] == pytest.approx(0.182, abs=1e-3)
    csv, png = map(Path, output["files"])
    assert len(csv.read_text().splitlines()) == 102
    assert png.is_file()
    assert len(csv.read_text().splitlines()[0].split(",")) == 7


def test_check_urdf_tells_facts_of_a_good_file(run):
    output = said(run, "check-urdf", ROOT / "urdf" / "nexus6.toml")
    assert output["faults"] == []
    assert any("5.8 kg" in fact for fact in output["facts"])
    assert output["next"] == f"rover-pin drive flat --set rover={ROOT / 'urdf' / 'nexus6.toml'}"


def test_check_urdf_fails_on_a_broken_file(run):
    text = (ROOT / "urdf" / "cart.urdf").read_text()
    Path("cart.urdf").write_text(text.replace('<mass value="', '<mass value="-'))
    Path("cart.toml").write_text((ROOT / "urdf" / "cart.toml").read_text())
    code, out, _ = run("check-urdf", "cart.toml", "--json")
    assert (code, "next" in json.loads(out)) == (1, False)
    assert any("mass" in fault for fault in strict(out)["faults"])


def test_sweep_writes_a_table(run):
    Path("three.toml").write_text(SWEEP)
    output = said(run, "sweep", "three.toml", "--workers", "1")
    assert (output["study"], output["cases"], output["failed"]) == ("three", 3, 0)
    assert all(Path(file).is_file() for file in output["files"])


def test_drive_and_bounds_take_a_model_file(run):
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.simulation.model.toml_file import write_model

    write_model(scenario("flat", gravity="moon", soil="fjs-1").model, "model.toml")
    output = said(run, "drive", "flat", "--model", "model.toml", "--set", "duration=1")
    plain = said(run, "drive", "flat", "--gravity", "moon", "--soil", "fjs-1", "--set", "duration=1")
    assert output["end_x_m"] == pytest.approx(plain["end_x_m"], abs=1e-6)
    output, plain = (
        said(run, "bounds", *a) for a in (["--model", "model.toml"], ["--gravity", "moon", "--soil", "fjs-1"])
    )
    assert output["wheels"] == plain["wheels"]
    code, _, err = run("bounds", "--model", "model.toml", "--soil", "table-1")
    assert code == 2
    assert "model.toml" in err
    assert "soil" in err


def test_bounds_for_every_wheel(run):
    output = said(run, "bounds", "--slope-deg", "5", "--gravity", "mars")
    assert [wheel["wheel"] for wheel in output["wheels"]] == ["fl", "fr", "ml", "mr", "rl", "rr"]
    assert all(0.0 < wheel["T_lim_Nm"] < wheel["T_sat_Nm"] for wheel in output["wheels"])
    code, out, _ = run("bounds")
    assert code == 0
    assert "T_sat" in out


def test_identify_says_what_the_data_tell(run):
    output = said(run, "identify", RIG, "--set", "phi=0.5")
    assert "soil.phi" not in output["parameters"]
    assert output["held"]["soil.phi"] == 0.5
    code, out, _ = run("identify", RIG, "--set", "phi=0.5")
    assert code == 0
    assert "soil.k = " in out


@pytest.mark.slow
def test_tune_writes_gains(run):
    Path("tiny.toml").write_text(TUNE)
    output = said(run, "tune", "tiny.toml", "--workers", "1", "--out", "tuned")
    assert Path("tuned/gains.toml").is_file()
    assert output["study"] == "tiny"


@pytest.mark.slow
def test_tune_takes_a_model_file_and_warns_of_ignored_effects(run):
    from rover_pin.effects.pivot_friction import PivotFriction
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.simulation.model.toml_file import write_model

    write_model(scenario("flat").model.having(PivotFriction()), "model.toml")
    Path("tiny.toml").write_text(TUNE)
    code, out, err = run("tune", "tiny.toml", "--model", "model.toml", "--workers", "1", "--out", "tuned", "--json")
    assert code == 0
    assert strict(out)["model"] == ["model.toml"]
    assert err.splitlines() == [f"rover-pin: warning: {strict(out)['warnings'][0]}"]


REFUSED = [  # a command line -> the texts that its error must contain, separated by "|"
    ("drive dicth", "'ditch'"),
    ("drive ditch --soil tabel-1", "'table-1'"),
    ("drive ditch --gravity erth", "'earth'"),
    ("drive ditch --gravity -3", "gravity|-3 m/s^2"),
    ("drive ditch --control pid", "'pid'|camera, cmd-vel, crab, eq9"),
    ("drive ditch --set soil.kk=1", "'soil.kk'|'soil.k'"),
    ("drive ditch --set soil.k", "--set soil.k|NAME=VALUE"),
    ("drive ditch --set soil.k=-1", "soil.k|-1 m|[1e-05, 0.5] m"),
    ("drive ditch --set soil.k=abc", "soil.k|'abc'"),
    ("drive ditch --set soil.phi=40", "soil.phi|40 deg"),
    ("drive ditch --set soil.phi=95deg", "soil.phi|95 deg|[0, 60] deg"),
    ("drive ditch --set duration=-1min", "duration|-1 min|[1.66667e-08, inf] min"),
    ("drive ditch --add DiggingMemory.length=90m", "DiggingMemory.length|90 m"),
    ("drive flat --effects SlipSinkge", "SlipSinkge"),
    ("bounds --effects gone.py", "gone.py"),
    ("drive ditch --set soil.k_mm=5", "soil.k_mm|soil.k=5mm"),
    ("drive ditch --set soil.k_deg=5", "'soil.k_deg'"),
    ("drive ditch --set soil.k=5kPa", "soil.k|'kPa'|m, mm, cm"),
    ("drive ditch --add DiggingMemory.length=5deg", "length|'deg'"),
    ("drive rocks --set terrain.diameters=3cm", "terrain.diameters|'3cm'|2 numbers"),
    ("identify gone --set soil.kk=1", "'soil.kk'|'soil.k'"),
    ("list soils fjs", "'fjs'|'fjs-1'"),
    ("list settings ditc", "'ditc'|'ditch'"),
    ("drive ditch --set duration=-1", "duration|-1 s|[1e-06, inf] s"),
    ("drive ditch --set dt=0.2", "dt|0.2 s|[1e-06, 0.1] s"),
    ("drive ditch --set start.x=nan", "start.x|nan m|[-1e+06, 1e+06] m"),
    ("drive ditch --set dt=1e-12", "dt|1e-12 s|[1e-06, 0.1] s"),
    ("drive ditch --set form=nett", "'net'"),
    ("drive ditch --set effect.SoilTraction.form=net", "effect.SoilTraction.form"),
    ("drive ditch --set rover=nexus7", "'nexus7'|'nexus6'"),
    ("drive flat --set rover=gone.toml", "'gone.toml'"),
    ("drive flat --set rover=broken.toml", "broken.toml|not TOML"),
    ("drive polyline --set terrain.path=gone.csv", "gone.csv"),
    ("drive polyline --set terrain.path=3", "cannot be read"),
    ("drive flat --engine pinocchio", "'pinocchio'|'pinocchio-aba'"),
    ("drive polyline", "terrain.csv|terrain.path=FILE"),
    ("drive grid", "terrain.npz|terrain.path=FILE"),
    ("close-loop empty.toml", "empty.toml"),
    ("drive flat --set duration=0.5 --out broken.toml", "broken.toml"),
    ("close-loop cmu-smooth-wheel --out broken.toml", "broken.toml"),
    ("curve --soil xx", "'xx'"),
    ("curve --k -1", "Soil.k|-1 m"),
    ("sweep gone.toml", "cannot be read"),
    ("sweep broken.toml", "is not TOML"),
    ("sweep empty.toml", "add it"),
    ("bounds --form nt", "'net'"),
    ("bounds --slip 3", "slip_limit = 3"),
    ("bounds --slope-deg 100", "slope|100 deg"),
    ("bounds --rover x", "rover 'x'"),
    ("bounds --gravity z", "gravity = 'z'"),
    ("identify gone", "gone: |rig.toml"),
    ("identify cmu-smooth-wheel --prior phi=30deg", "--prior phi=30deg"),
    ("identify cmu-smooth-wheel --prior kk=1:1", "kk|'k'"),
    ("identify cmu-smooth-wheel --prior k", "--prior k|NAME=MEAN:SD"),
    ("identify cmu-smooth-wheel --prior phi=30deg:2", "--prior phi=30deg:2"),
    ("identify cmu-smooth-wheel --prior phi=30:2", "soil.phi|30 rad"),
    ("drive flat --set soil.k=0,01", "'0,01'"),
    ("drive flat --set rover=3", "rover = 3"),
    ("drive flat --gravity 1.62kg", "gravity = '1.62kg'"),
    ("bounds --slope-deg 5m", "--slope-deg: unit 'm'"),
    ("bounds --slope-deg steep", "--slope-deg = 'steep'"),
    ("curve --k 10kg", "--k: unit 'kg'"),
    ("init gone.csv --r 45 --b 50", "Wheel.r = 45 m"),
    ("identify empty.csv", "empty.csv"),
    ("close-loop gone", "gone: "),
    ("close-loop gone --model empty.toml", "gone: "),
    ("tune gone.toml", "cannot be read"),
    ("tune broken.toml", "not TOML"),
    ("tune sand.toml --model gone.toml", "gone.toml"),
    ("tune sand.toml --model broken.toml", "broken.toml|not TOML"),
    ("tune sand.toml --model empty.toml", "empty.toml|kind|None"),
    ("tune sand.toml --model model.toml", "training 1|model.toml|soil"),
    ("driv", "'driv'|'drive'"),
    ("drive", "'scenario'|rover-pin drive --help"),
    ("drive ditch --contrl eq9", "--contrl|--control"),
    ("drive ditch --rover x.toml", "'x.toml'"),
    ("drive ditch --duration 3", "--set duration="),
    ("drive ditch --terrain.depth 3cm", "--terrain.depth"),
    ("drive ditch --rovr x.toml", "--rovr"),
    ("check-urdf --rover x.toml", "--rover"),
    ("curve --n abc", "--n = 'abc'"),
    ("drive ditch --out", "Option '--out' requires"),
    ("check-urdf", "Missing argument"),
]


@pytest.fixture
def files(run):
    Path("broken.toml").write_text("kind = [")
    Path("empty.toml").write_text("")
    Path("model.toml").write_text("kind = 'drive-model'")
    Path("sand.toml").write_text("[[training]]\nscenario = 'flat'\nsoil = 'dry-sand'")
    Path("empty.csv").write_text("")


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(("line", "fields"), REFUSED, ids=[line for line, _ in REFUSED])
def test_what_is_refused_gets_one_sentence(run, line, fields):
    code, out, err = run(*line.split())
    assert code == 2
    assert [field for field in fields.split("|") if field not in err] == []
    assert err.strip().startswith("rover-pin: ")
    assert len(err.strip().splitlines()) == 1
    assert out == ""


def test_the_installed_command_runs_without_a_traceback(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "rover_pin.cli.app", "drive", "dicth"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "scenario 'dicth'" in done.stderr


def test_help_waits_for_no_arrays_and_no_tables():
    code = "import sys, rover_pin.cli.app; sys.exit(' '.join({'numpy', 'pandas', 'casadi'} & sys.modules.keys()) or 0)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def test_a_drive_waits_for_no_tables(tmp_path):
    """pandas takes half of its time, and of its memory."""
    code = (
        "import sys; from typer.testing import CliRunner; from rover_pin.cli.app import app;"
        "done = CliRunner().invoke(app, ['drive', 'flat', '--set', 'duration=1', '--out', 'out']);"
        "sys.exit(done.exit_code or int('pandas' in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize(
    ("user_setting", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2"), ({"OMP_NUM_THREADS": "2"}, "None")]
)
def test_linear_algebra_takes_one_thread_unless_told(user_setting, threads):
    code = (
        "import atexit, os\nfrom rover_pin.__main__ import main\n"
        "atexit.register(lambda: print(os.environ.get('OPENBLAS_NUM_THREADS')))\nmain()"
    )
    env = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")} | user_setting
    done = subprocess.run([sys.executable, "-c", code, "--help"], env=env, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == threads


def test_nothing_prints_through_rich_but_the_plain_console():
    users = [path.name for path in (ROOT / "rover_pin").rglob("*.py") if "import Console" in path.read_text()]
    assert users == ["console.py"]


def test_drive_prints_a_short_table(run):
    code, out, _ = run("drive", "flat", "--set", "duration=1")
    assert code == 0
    assert "scenario" in out
    assert "end x" in out
    assert len(out.splitlines()) <= 24
    assert Path("out/drive/log/drive.toml").is_file()
