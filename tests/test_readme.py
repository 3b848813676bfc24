"""The README is true: its commands run, and its numbers are those of `studies/results`."""

import importlib
import math
import re
import tomllib
from pathlib import Path

import pytest

from rover_pin import SOILS, load_rover
from rover_pin.cli.app import app
from rover_pin.rover.description.layout import KEYS, read_forms, read_motor, read_soil, read_springs
from rover_pin.scenarios.scenes import SCENES
from rover_pin.version import __version__

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
SMOOTH, SUPPLY = "commands.smooth_wheel", "commands.supply"
CLAIMS = [
    f"sinkage error falls from {{{{ dec({SMOOTH}.before, 1) }}}} mm to {{{{ dec({SMOOTH}.after, 1) }}}} mm",
    f"probabilities {{{{ dec({SMOOTH}.exponent, 2) }}}} (slip-sinkage, n_1 = {{{{ printed({SMOOTH}, 'n_1', 2) }}}})",
    f"and {{{{ dec({SMOOTH}.softening, 2) }}}} (slip-softening)",
    "drives on at {{ commands.ditch.speed }} m/s",
    f"R_b = {{{{ dec({SUPPLY}.R_b, 2) }}}} ohm "
    f"[{{{{ dec({SUPPLY}.R_b_low, 2) }}}}, {{{{ dec({SUPPLY}.R_b_high, 2) }}}}]",
    f"bus voltage falls from {{{{ sig(1000 * {SUPPLY}.before, 2) }}}} mV to {{{{ sig(1000 * {SUPPLY}.after, 2) }}}} mV",
    "in {{ took['close-loop demo-drive-log'] }} s of CPU",
    "after {{ took['close-loop cmu-smooth-wheel'] }} s of CPU",
    "differs by {{ sig(speed.drive_speed['off [mm]'], 1) }} mm from a drive at a sixteenth",
    "take {{ sig(speed.drive_speed['ditch [s]'], 2) }} s of CPU",
    "Of [{{ control.drives }} drives](docs/results.md#controllers-compared), constant duty passes "
    "{{ control.rows['constant duty'].passed }} and buries {{ control.rows['constant duty'].buried }}.",
    *(
        f"| {words} | {{{{ control.rows['{name}'].passed }}}} | {{{{ control.rows['{name}'].buried }}}} |"
        for name, words in (
            ("S_d = 0.2, true slip", "S_d = 0.2, true slip"),
            ("by the hole, true slip", "target slip lowered as a wheel's hole deepens, true slip"),
            ("by the hole, on board", "the same, slip estimated on board"),
        )
    ),
    "it passes {{ beliefs.of['unknown sand'].project.passed }} and buries "
    "{{ beliefs.of['unknown sand'].project.buried }} of {{ beliefs.drives }} [other drives]",
    "where constant duty passes {{ beliefs.of['constant duty'].project.passed }} and buries "
    "{{ beliefs.of['constant duty'].project.buried }}.",
    "the answer contains this effect in {{ ' of '.join(blind.rigs.counts.named) }} cases",
    "Without a hidden effect, {{ ' of '.join(blind.rigs.counts.alarms) }} cases are false alarms",
    "wheel rigs, {{ blind.rigs.sets }} sets | drive logs, {{ blind.logs.sets }} sets",
    *(
        "| " + " | ".join(f"{{{{ ' of '.join(blind.{part}.counts.{what}) }}}}" for part in ("rigs", "logs")) + " |"
        for what in ("named", "alarms", "abstained", "intervals")
    ),
    "{{ ' of '.join(blind.rigs.counts['laws']) }} rigs",
    "Pairs of hidden effects are found on {{ ' of '.join(blind.rigs.counts['pairs']) }} rigs",
    "on {{ ' of '.join(blind.rigs.counts.wrong) }} rigs and {{ ' of '.join(blind.logs.counts.wrong) }} logs",
]


@pytest.fixture
def numbers(monkeypatch):
    """What puts numbers into pages."""
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("page_numbers")


def page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(language, text=TEXT):
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_one_line_sets_up_and_does_the_main_job():
    install, drive = blocks("sh")[:2]
    assert install.count("\n") == drive.count("\n") == 1
    assert install.startswith("python3 -m venv .venv && . .venv/bin/activate && ")
    assert "rover-pin close-loop" in install


@pytest.mark.parametrize("claim", CLAIMS)
def test_a_number_is_that_of_the_results(numbers, claim):
    """The one page that is read as it stands: its numbers are fields of results, as those of the site are."""
    assert numbers.fill_in(claim) in " ".join(TEXT.replace("**", "").split())


def test_pages_name_fields_that_results_have(numbers):
    pages = [path for path in DOCS.glob("*.md") if "{{" in path.read_text(encoding="utf-8")]
    assert len(pages) > 4
    for path in pages:
        assert "{{" not in numbers.fill_in(path.read_text(encoding="utf-8"))


def test_a_field_that_no_result_has_is_refused(numbers):
    with pytest.raises(numbers.jinja2.UndefinedError):
        numbers.fill_in("{{ speed.drive_speed.unknown }}")


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
    rooms = "|".join(path.name for path in (ROOT / "rover_pin").iterdir() if path.is_dir())
    named |= {f"rover_pin/{path}" for path in re.findall(rf"`((?:{rooms})/[\w./]*\.(?:py|c))", text)}
    assert len(named) > 20
    named = {re.sub(r"^(notebooks/.*)\.md$", r"\1.ipynb", path) for path in named}
    assert not [path for path in sorted(named) if not (ROOT / path).exists()]


def test_the_page_of_commands_shows_every_command(numbers):
    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    assert names == {line.split()[1] for line in numbers.kept("times").command}


def test_the_conda_recipe_needs_what_the_package_needs():
    recipe = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    called = {"pin": "pinocchio", "matplotlib": "matplotlib-base"}
    needed = {f"python {project['requires-python']}", "c-compiler"}
    for line in project["dependencies"]:
        name, sign, version = line.partition(">=")
        needed.add(f"{called.get(name, name)} {sign}{version}")
    run = recipe.partition("  run:\n")[2].partition("tests:")[0]
    assert set(re.findall(r"^    - (.+)$", run, re.MULTILINE)) == needed
    assert f'version: "{__version__}"' in recipe
    assert "rover-pin = " + project["scripts"]["rover-pin"] in recipe


def test_the_only_sample_of_a_log_is_simulated_as_it_says():
    logs = [
        tomllib.loads(file.read_text(encoding="utf-8")) for file in (ROOT / "studies" / "data").glob("*/drive.toml")
    ]
    assert [log["source"].startswith("Simulated") for log in logs] == [True]
    assert "No drive log of a real rover ships as a sample" in TEXT


def test_it_counts_the_scenarios():
    assert f"has {len(SCENES) - 1} more grounds" in TEXT
