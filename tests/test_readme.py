"""The README is short and true: 900 words, two commands to the first drive, numbers that are those of the pages."""

import math
import re
import tomllib
from pathlib import Path

import pytest

from rover_pin.cli.app import app
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.parameters import SOILS, TABLE_1
from rover_pin.rover.description.layout import KEYS
from rover_pin.rover.description.rover_toml import read_forms, read_motor, read_soil, read_springs
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.scenarios.scenes import SCENES
from rover_pin.soil.traction import FORMS, load_traction_factor

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_WORDS = 900
NUMBERS = ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
NUMBERS += [f"{each}teen" for each in ("thir", "four", "fif", "six", "seven", "eigh", "nine")] + ["twenty"]


def page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(language, text=TEXT):
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def rows(text):
    """The rows of a page's tables: lists of their cells."""
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| ")]


def test_it_is_short():
    assert len(TEXT.split()) <= MOST_WORDS
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 8


def test_one_line_sets_up_and_does_the_main_job():
    install, drive = blocks("sh")[:2]
    assert install.count("\n") == drive.count("\n") == 1
    set_up = "python3 -m venv .venv && . .venv/bin/activate && "
    assert install == f'{set_up}pip install -e ".[view]" && rover-pin close-loop cmu-smooth-wheel --open\n'
    assert blocks("sh")[-1] == f'{set_up}pip install -e ".[dev]" && pytest -n 2 -m "not nightly"\n'
    assert drive.startswith("rover-pin drive ditch ")


def test_what_it_says_of_trust_is_what_the_tables_say():
    """A row of the README is a row of each table of the page: names, false alarms, abstentions, intervals."""
    _, both = page("validation.md").split("## Wheel-rig sets")
    rigs, logs = (rows(part) for part in both.split("## Drive logs"))

    def count(table, what):
        return next(row[1] for row in table if what in row[0])

    alike = [
        "detectable: named, or in the stated set", "nothing hidden: false alarm",
        "on no list, beyond the noise: abstained", "95 % intervals that hold",
    ]  # fmt: skip
    said = [row[1:] for row in rows(TEXT) if " of " in row[1]]
    found = [[count(rigs, what), count(logs, what)] for what in alike]
    assert [[cell.strip("*") for cell in row] for row in said] == found


def test_what_it_says_of_speed_is_what_the_page_says():
    page_said = re.search(r"take ([\d.]+) s \(.*?x is within ([\d.]+) mm", " ".join(page("speed.md").split()))
    said = re.search(r"to ([\d.]+) mm of a sixteenth .*? ditch in ([\d.]+) s", " ".join(TEXT.split()))
    assert said[1] == page_said[2]
    assert float(said[2]) == pytest.approx(float(page_said[1]), abs=0.005)


def test_it_counts_the_scenarios():
    assert f"has {NUMBERS[len(SCENES) - 1]} more grounds" in TEXT


def test_the_toml_is_a_rover(tmp_path):
    code, _ = blocks("toml", page("own-rover.md"))
    (tmp_path / "mine.toml").write_text(code)
    (tmp_path / "cart.urdf").write_text((ROOT / "urdf" / "cart.urdf").read_text())
    assert len(load_rover(tmp_path / "mine.toml").wheels) == 4


def test_the_further_tables_are_those_of_a_rovers_toml():
    """Each is read as it stands, but for the joints, which are of a rover with such parts."""
    table = tomllib.loads(blocks("toml", page("own-rover.md"))[1])
    assert set(table) <= set(KEYS)
    table |= {"base": "hull", "suspension": {"rocker": ["rocker_l", "rocker_r"]}}
    forms = read_forms(table, "own-rover.md", (), {}, None)
    assert forms.base_rpy[0] == pytest.approx(math.pi)
    assert forms.coupled == {"bar": ("rocker_l", -0.5)}
    assert [spring.joint for spring in read_springs(table, "own-rover.md")] == ["rocker"]
    assert float(read_motor(table, "own-rover.md").no_load_speed) == pytest.approx(20 * math.pi / 30)
    assert read_soil(table, "own-rover.md")["name"] in SOILS


def test_the_files_that_the_texts_name_are_there():
    text = "".join(path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *DOCS.glob("*.md")])
    named = set(re.findall(r"(?:studies|urdf|tests|docs|notebooks|rover_pin)/[\w./-]*\w", text))
    named |= {
        f"rover_pin/{path}"
        for path in re.findall(
            r"`((?:base|soil|effects|terrain|rover|simulation|logs|control|scenarios|tuning|discrepancy|loop)/[\w./]*\.(?:py|c))",
            text,
        )
    }
    assert len(named) > 20
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]


def test_the_page_of_commands_shows_every_command():
    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    assert names == set(re.findall(r"^\| `([\w-]+)` \| `rover-pin \1 ", page("command-line.md"), re.MULTILINE))


@pytest.mark.parametrize("name", FORMS)
def test_the_traction_table_has_the_numbers_of_table_1(name, nexus6_wheel):
    row = next(line for line in page("paper.md").splitlines() if line.startswith(f"| `{name}` |"))
    *factors, slopes = row.split("|")[3:7]
    computed = [load_traction_factor(S, TABLE_1, nexus6_wheel, FORMS[name]) for S in (0.0, 0.2, 1.0)]
    assert [float(cell) for cell in factors] == pytest.approx(computed, abs=5.1e-4)
    held = sum(
        float(effect.R)
        for effect in scenario("flat", soil="table-1", form=name).model.effects
        if isinstance(effect, MotionResistance)
    )
    steepest = [math.degrees(math.atan(computed[-1] - R)) for R in (0.0, held)[: 2 if held else 1]]
    printed = [float(cell) for cell in slopes.replace("deg", "").split(",") if cell.strip() != "-"]
    assert printed == pytest.approx(steepest, abs=0.051)


@pytest.fixture
def nexus6_wheel():
    return load_rover().wheel
