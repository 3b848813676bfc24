"""The README does what it says: its Python runs, its TOML is a rover, its files, commands and numbers exist."""

import math
import re
import tomllib
from pathlib import Path

import pytest

from rover_pin.body.rover import load_rover
from rover_pin.cli import app
from rover_pin.description.layout import KEYS
from rover_pin.description.rover_toml import read_forms, read_motor, read_soil, read_springs
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.parameters import SOILS, TABLE_1
from rover_pin.scenarios import scenario
from rover_pin.soil.traction import FORMS, load_traction_factor

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.parametrize("code", blocks("python"), ids=lambda code: code.splitlines()[0][:40])
def test_the_python_runs(code, tmp_path, monkeypatch, capsys):
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    monkeypatch.chdir(tmp_path)
    # Dataclasses look their module up by name, so the block needs one.
    exec(compile(code, "README.md", "exec"), {"__name__": __name__})
    assert capsys.readouterr().out


def test_the_example_is_short():
    assert len([line for line in blocks("python")[0].splitlines() if line.strip()]) <= 20


def test_the_toml_is_a_rover(tmp_path):
    code, _ = blocks("toml")
    (tmp_path / "mine.toml").write_text(code)
    (tmp_path / "cart.urdf").write_text((ROOT / "urdf" / "cart.urdf").read_text())
    assert len(load_rover(tmp_path / "mine.toml").wheels) == 4


def test_the_further_tables_are_those_of_a_rovers_toml():
    """Each is read as it stands, but for the joints, which are of a rover with such parts."""
    table = tomllib.loads(blocks("toml")[1])
    assert set(table) <= set(KEYS)
    table |= {"base": "hull", "suspension": {"rocker": ["rocker_l", "rocker_r"]}}
    forms = read_forms(table, "README.md", (), {}, None)
    assert forms.base_rpy[0] == pytest.approx(math.pi)
    assert forms.coupled == {"bar": ("rocker_l", -0.5)}
    assert [spring.joint for spring in read_springs(table, "README.md")] == ["rocker"]
    assert float(read_motor(table, "README.md").no_load_speed) == pytest.approx(20 * math.pi / 30)
    assert read_soil(table, "README.md")["name"] in SOILS


def test_there_are_two_commands_for_a_bare_machine():
    commands = blocks("sh")
    assert len(commands) == 2
    assert all(command.startswith("python3 -m venv .venv && ") and command.count("\n") == 1 for command in commands)


def test_the_files_it_names_are_there():
    named = set(re.findall(r"(?:studies|urdf|tests|docs|rover_pin)/[\w./-]*\w", TEXT))
    named |= {
        f"rover_pin/{path}" for path in re.findall(r"`((?:soil|effects|body|motion|control)/[\w./]*\.(?:py|c))", TEXT)
    }
    assert len(named) > 20
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]


def test_it_shows_every_command():
    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    assert names == set(re.findall(r"^\| `([\w-]+)` \| `rover-pin \1 ", TEXT, re.MULTILINE))


@pytest.mark.parametrize("name", FORMS)
def test_the_traction_table_has_the_numbers_of_table_1(name, nexus6_wheel):
    row = next(line for line in TEXT.splitlines() if line.startswith(f"| `{name}` |"))
    *factors, slopes = row.split("|")[3:7]
    computed = [load_traction_factor(S, TABLE_1, nexus6_wheel, FORMS[name]) for S in (0.0, 0.2, 1.0)]
    assert [float(cell) for cell in factors] == pytest.approx(computed, abs=5.1e-4)
    held = sum(
        float(effect.R) for effect in scenario("flat", form=name).model.effects if isinstance(effect, MotionResistance)
    )
    steepest = [math.degrees(math.atan(computed[-1] - R)) for R in (0.0, held)[: 2 if held else 1]]
    printed = [float(cell) for cell in slopes.replace("deg", "").split(",") if cell.strip() != "-"]
    assert printed == pytest.approx(steepest, abs=0.051)


@pytest.fixture
def nexus6_wheel():
    return load_rover().wheel
