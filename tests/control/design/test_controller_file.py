"""A controller from a user's file: it drives where the user named it, and its mistakes are sentences."""

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.base.trust import Trust
from rover_pin.cli.app import app
from rover_pin.scenarios.scenario import scenario

CAREFUL = '''"""Half the duty where the nose points up."""


class Careful:
    def __init__(self, wheels):
        self.wheels, self.samples = wheels, 0

    def reset(self):
        self.samples = 0

    def __call__(self, reading):
        self.samples += 1
        return [0.25 if -reading.attitude[1] > 0.05 else 0.55] * self.wheels


def controller(model):
    return Careful(len(model.rover.wheels))
'''


def written(folder, text=CAREFUL):
    file = folder / "careful.py"
    file.write_text(text)
    return file


def test_a_file_drives_as_its_controller_does(tmp_path):
    file = written(tmp_path)
    hill = {"terrain.angle_deg": 6.0, "terrain.start": 0.2, "duration": 8.0}
    case = scenario("incline", control=str(file), trust=Trust.of(file), **hill)
    trace = case.drive()
    duty = trace["duty_fl"]
    assert set(np.round(duty, 3)) == {0.25, 0.55}
    assert case.drive()["body_x"].tobytes() == trace["body_x"].tobytes(), "it is reset"


def test_it_runs_only_where_the_user_says_so(tmp_path):
    with pytest.raises(DataError, match="consent"):
        scenario("flat", control=str(written(tmp_path)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "no function `controller"),
        ("def controller(model):\n    return 0.3\n", "returns 0.3"),
        ("def controller(model):\n    return model.wheels\n", "line 2.*AttributeError"),
        ("def controller(model)\n", "line 1.*SyntaxError"),
    ],
)
def test_a_mistake_is_a_sentence(tmp_path, text, message):
    file = written(tmp_path, text)
    with pytest.raises(DataError, match=message):
        scenario("flat", control=str(file), trust=Trust.of(file))


def test_the_command_takes_the_file_that_it_names(tmp_path):
    command = [
        "drive",
        "flat",
        "--control",
        str(written(tmp_path)),
        "--set",
        "duration=1",
        "--out",
        str(tmp_path / "out"),
    ]
    completed = CliRunner().invoke(app, command)
    assert completed.exit_code == 0, completed.output
    (tmp_path / "study.toml").write_text("")
    completed = CliRunner().invoke(app, ["drive", "flat", "--set", f"control={tmp_path / 'careful.py'}"])
    assert isinstance(completed.exception, DataError)


def test_an_error_while_it_drives_names_the_line(tmp_path):
    file = written(tmp_path, "def controller(model):\n    return lambda reading: 0.01 / (0.5 - min(reading.t, 0.5))\n")
    with pytest.raises(DataError, match=r"careful\.py, line 2: .*ZeroDivisionError"):
        scenario("flat", control=str(file), trust=Trust.of(file), duration=1.0).drive()
