"""A slip control that is exported as C compiles without a warning, and its results equal the results of the package at
every sample.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from rover_pin import scenario
from rover_pin.cli.app import app
from rover_pin.onboard.embedded.folder import TOLERANCE, TOLERANCE_ON_BOARD, control_export, write_control
from rover_pin.onboard.embedded.motion import embedded_motion
from rover_pin.onboard.embedded.source import embed
from rover_pin.onboard.embedded.vectors import vectors
from rover_pin.simulation.command import Reading, Truth
from rover_pin.simulation.compiled.toolchain import compiler

STRICT = ("-std=c11", "-Wall", "-Werror", "-O2", "-ffp-contract=off")
SANE = (*STRICT[:3], "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
CONTROLS = {
    "eq9": {"control": "eq9"},
    "eq9 without limit": {"control": "eq9", "control.limit": "none"},
    "eq9 in holes": {"control": "eq9", "control.aim": "hole", "control.limit": "at-slip"},
    "slip given": {"control": "true", "control.aim": "hole"},
    "on board": {"control": "onboard"},
    "on board, never stopped": {"control": "onboard", "control.stop": "never", "control.aim": "constant"},
    "camera": {"control": "camera"},
}


def export(**settings):
    chosen = scenario("ditch", **settings)
    return embed(chosen.controller, chosen.model)


def built(folder, flags=STRICT):
    words = [*compiler(), *flags, "rover_control.c", "test_vectors.c", "-lm", "-o", "test_vectors"]
    completed = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    return folder / "test_vectors"


def stepped(program, limit="1e-12"):
    return subprocess.run(
        [program, "vectors.csv", limit], cwd=program.parent, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("settings", CONTROLS.values(), ids=CONTROLS)
def test_c_answers_as_the_package(settings, tmp_path):
    """The particles of an on-board estimate amplify rounding, so that their limit is that of the exported folder."""
    library = export(**settings)
    write_control(library, tmp_path)
    done = stepped(built(tmp_path), str(TOLERANCE_ON_BOARD if library.on_board else TOLERANCE))
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("400 samples")


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(settings, id=name, marks=[] if name in ("eq9", "on board") else pytest.mark.nightly)
        for name, settings in CONTROLS.items()
    ],
)
def test_ten_thousand_samples_under_sanitizers(settings, tmp_path):
    library = export(**settings)
    write_control(library, tmp_path, 10_000)
    done = stepped(built(tmp_path, SANE), "1e-10" if library.on_board else "1e-12")
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert done.stdout.startswith("10000 samples")


def test_vectors_notice_a_number_that_is_otherwise(tmp_path):
    write_control(export(control="eq9"), tmp_path)
    source = (tmp_path / "rover_control.c").read_text()
    head, table = source.split("TABLE_SPEED[", 1)
    (tmp_path / "rover_control.c").write_text(head + "TABLE_SPEED[" + table.replace("0.0, 0.0", "0.0, 0.001", 1))
    assert stepped(built(tmp_path)).returncode == 1


@pytest.mark.parametrize("control", ["eq9", "cmd-vel"])
def test_the_test_program_states_why_it_ends_without_a_test(control, tmp_path):
    chosen = scenario("ditch", control=control)
    write_control(control_export(chosen.controller, chosen.model), tmp_path)
    program = built(tmp_path)
    (tmp_path / "empty.csv").touch()
    for words, named in (((), "vectors.csv [LIMIT]"), (("missing.csv",), "missing.csv"), (("empty.csv",), "empty.csv")):
        done = subprocess.run([program, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (2, "")
        assert named in done.stderr


def test_vectors_try_all_that_a_control_decides():
    """The test vectors contain duties within and at their limits, stops and their ends, and certain and uncertain
    estimates and forecasts.
    """
    rows = np.array(list(vectors(export(control="onboard"), 2000)))
    duty, stands, stopped, ahead = rows[:, -29:-23], rows[:, -11], rows[:, -10], rows[:, -9:]
    assert 0.05 < stopped.mean() < 0.95
    assert stands.min() < 0.1 < 0.9 < stands.max()
    assert np.unique(np.round(duty, 6)).size > 100
    assert rows[:, 0].sum() == 20
    p_stuck, p_buried, alarm, cause = ahead.T[:4]
    assert np.unique(p_stuck).size > 10
    assert np.unique(p_buried).size > 10
    assert 0.0 < alarm.mean() < 1.0
    assert set(cause) >= {-1.0, 0.0, 1.0, 2.0, 3.0}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
def test_cmake_builds_and_tests_it(tmp_path):
    write_control(export(control="eq9"), tmp_path)
    for words in (["cmake", "-B", "build", "."], ["cmake", "--build", "build"], ["ctest", "--test-dir", "build"]):
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_command_writes_and_states_how_to_build(tmp_path):
    done = CliRunner().invoke(app, ["export-c", "ditch", "--control", "eq9", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "cc -std=c11" in done.output
    assert stepped(built(tmp_path)).returncode == 0


def test_a_reset_estimate_has_no_memory():
    library = export(control="onboard")
    first, second = list(vectors(library, 100)), list(vectors(library, 200))[100:]
    estimate = library.on_board
    outputs = []
    for rows in (first, second, first):
        estimate.reset()
        links, wheels = library.links, 6
        for row in rows:
            duty, others = row[1 : 1 + wheels], row[1 + wheels :]
            sample = estimate.belief.sample
            sample[2 + links :] = others[: 2 * wheels]
            sample[2 : 2 + links] = others[2 * wheels : 2 * wheels + links]
            sample[:2] = others[2 * wheels + links : 2 * wheels + links + 2]
            estimate.belief.sense(max(duty) < -0.02, float("nan"))
        outputs.append((estimate.belief.estimates.copy(), estimate.p_stands, estimate.speed))
    np.testing.assert_array_equal(outputs[0][0], outputs[2][0])
    assert outputs[0][1:] == outputs[2][1:]


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
@pytest.mark.parametrize("control", ["eq9", "onboard"])
def test_ros2_controller_gives_the_package_s_duties(control, tmp_path):
    """The controller is compiled against a replacement of ros2_control, because no package registry offers the
    original.
    """
    chosen = scenario("ditch", control=control)
    library = embed(chosen.controller, chosen.model)
    write_control(library, tmp_path, 1)
    stand_in = Path(__file__).parent / "ros2_stand_in"
    subprocess.run([*compiler(), "-c", *STRICT[:3], "rover_control.c"], cwd=tmp_path, check=True)
    words = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-O1", f"-I{tmp_path}", f"-I{tmp_path / 'ros2'}"]
    words += [f"-I{stand_in}", str(stand_in / "main.cpp"), "rover_control.o", "-o", "run"]
    completed = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    duty, rows, expected = np.zeros(6), [], []
    random = np.random.default_rng(2)
    for k in range(60):
        rate, current = 0.8 + 0.1 * random.standard_normal((2, 6))
        links, (roll, pitch) = 0.1 * random.standard_normal(library.links), 0.1 * random.standard_normal(2)
        orientation = Rotation.from_euler("xyz", [roll, pitch, 0.3]).as_quat()
        rows.append([*rate, *current, *links, *orientation])
        nothing = Truth(*np.full((4, 6), np.nan), *np.full((2, 3), np.nan))
        reading = Reading(0.05 * k, duty, rate, current, links, (roll, pitch, 0.3), nothing)
        duty = np.asarray(chosen.controller(reading).duty)
        expected.append(duty)
    text = "\n".join(" ".join(map(repr, map(float, row))) for row in rows)
    done = subprocess.run([tmp_path / "run"], input=text, capture_output=True, text=True, check=True)
    names, *lines = done.stdout.strip().splitlines()
    assert names.split()[:2] == ["wheel_fl/velocity", "wheel_fr/velocity"]
    assert names.split()[-6:] == [f"wheel_{wheel}/duty" for wheel in ("fl", "fr", "ml", "mr", "rl", "rr")]
    # Roll and pitch pass through a quaternion, and the weights of the particles amplify its rounding.
    limit = TOLERANCE_ON_BOARD if control == "onboard" else 1e-9
    np.testing.assert_allclose([[float(word) for word in line.split()] for line in lines], expected, rtol=0, atol=limit)


def test_a_control_that_is_given_the_slip_has_no_ros2_package(tmp_path):
    write_control(export(control="true"), tmp_path, 1)
    assert not (tmp_path / "ros2").exists()


def motion_of(rover, **settings):
    chosen = scenario("flat", rover=rover, control="cmd-vel", **settings)
    return embedded_motion(chosen.controller, chosen.model.rover)


@pytest.mark.parametrize("rover", ["nexus6", "cart"])
def test_held_speeds_in_c_are_those_of_the_class(rover, tmp_path):
    """Rovers with and without steering are tried, below and at the limit of the supply, with a reset after every 100
    samples.
    """
    write_control(motion_of(rover), tmp_path)
    done = stepped(built(tmp_path))
    assert done.returncode == 0, done.stdout
    assert done.stdout.startswith("400 samples")
    table = np.genfromtxt(tmp_path / "vectors.csv", delimiter=",", names=True)
    duties = np.array([table[name] for name in table.dtype.names if name.startswith("duty_")])
    assert 0.05 < np.mean(np.abs(duties) == 1.0) < 0.9


def test_the_command_takes_held_speeds_away(run, tmp_path):
    code, _, _ = run("export-c", "flat", "--control", "cmd-vel", "--set", "rover=cart", "--out", "export")
    assert code == 0
    assert stepped(built(tmp_path / "export")).returncode == 0
    for control in ("rates", "route"):
        code, _, err = run("export-c", "flat", "--control", control, "--out", "export")
        assert (code, "cmd-vel" in err) == (2, True)
