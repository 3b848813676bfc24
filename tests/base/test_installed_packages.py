"""An installed package offers an effect, a soil and an experiment: found by name, listed with their source, used."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from rover_pin import SOILS, close_the_loop, scenario
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.loop.own_code import experiment_of_folder, installed_experiments, refuse_unfit_offered_effects
from rover_pin.scenarios.catalogue import effects, soils
from rover_pin.simulation.compiled.laws import contact_law
from rover_pin.simulation.model.effect_files import installed_effects, known_effects
from rover_pin.simulation.model.effect_words import having
from rover_pin.simulation.model.toml_file import model_files, read_model, write_model
from rover_pin.terrain.shapes import flat

CODE = '''"""Laws and data of a package that this test installs."""
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Soil
from rover_pin.effects.effect import Effect
from rover_pin.experiments.motor_brake import MotorBrake


@dataclass(frozen=True)
class ClayGrip(Effect):
    """torque += a tanh(rim / v_0): clay on the rim holds it back."""

    a: float = quantity(0.02, "N m", "assumed", 0.0, 1.0, "a")
    v_0: float = quantity(0.005, "m/s", "assumed", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple) -> Load:
        return Load(torque=self.a * ca.tanh(contact.rim / self.v_0))


@dataclass(frozen=True)
class RedClay(Soil):
    """Red clay of a test."""

    k: float = quantity(0.011, "m", "this test", 1e-5, 0.5, "k")


class Joint(MotorBrake):
    """A joint of a test stand."""

    file = "joint.toml"
'''
PAGE = (Path(__file__).parents[2] / "docs" / "own-package.md").read_text(encoding="utf-8")
(PYPROJECT,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
OFFERS = {
    group: "\n".join(f"{name} = {place}" for name, place in entries.items())
    for group, entries in tomllib.loads(PYPROJECT)["project"]["entry-points"].items()
}
"""Group -> entry points, as the page prints them."""


def install(folder, code=CODE, offers=OFFERS, name="clay-laws", module="clay_laws"):
    """Write what pip writes for a package: the module, its metadata and its entry points."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(code)
    info = folder / f"{name.replace('-', '_')}-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("".join(f"[{group}]\n{line}\n" for group, line in offers.items()))
    return folder


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A function that installs a package for this test alone."""

    def put(*args, **named):
        folder = install(tmp_path / "site", *args, **named)
        if str(folder) not in sys.path:
            monkeypatch.syspath_prepend(str(folder))
        monkeypatch.delitem(sys.modules, named.get("module", "clay_laws"), raising=False)
        return folder

    return put


def test_an_effect_is_driven_written_and_read_by_name(installed, tmp_path):
    installed()
    scene = scenario("flat", duration=1.0)
    stuck, free = having(scene.model, "ClayGrip.a=0.5"), scene.model
    (grip,) = [effect for effect in stuck.all_effects if type(effect).__name__ == "ClayGrip"]
    assert float(grip.a) == 0.5
    assert (
        scenario("flat", model=write_model(stuck, tmp_path / "m.toml"), duration=1.0).drive()["body_x"][-1]
        < 0.9 * (scene.drive()["body_x"][-1])
    )
    # The file names the package, not a path, so that it may be read without further consent and on another computer.
    text = (tmp_path / "m.toml").read_text()
    assert 'package = "clay-laws"' in text
    assert str(tmp_path) not in text
    assert grip in read_model(tmp_path / "m.toml", flat()).all_effects
    assert grip not in free.all_effects
    assert [path.name for path in model_files(tmp_path / "m.toml")] == ["m.toml", "clay_laws.py"]


def test_a_model_whose_package_is_missing_states_the_package(installed, tmp_path, monkeypatch):
    folder = installed()
    path = write_model(having(scenario("flat").model, "ClayGrip"), tmp_path / "m.toml")
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry != str(folder)])
    with pytest.raises(DataError, match=r"'ClayGrip' belongs to the package 'clay-laws'.*trust"):
        read_model(path, flat())
    # A package that offers the same name under another maker does not replace it.
    other = install(tmp_path / "other", name="other-laws")
    monkeypatch.syspath_prepend(str(other))
    with pytest.raises(DataError, match="'clay-laws'"):
        read_model(path, flat())


def test_the_loop_may_add_it(installed):
    assert "ClayGrip" not in {kind.__name__ for kind in known_effects()}
    installed()
    assert {"ClayGrip", "SlipSinkage"} <= {kind.__name__ for kind in known_effects()}
    refuse_unfit_offered_effects()


def test_a_soil_is_found_and_driven_by_name(installed):
    with pytest.raises(ParameterError, match="red-clay"):
        SOILS["red-clay"]
    installed()
    assert SOILS["red-clay"].k == 0.011
    assert list(SOILS)[-1] == "red-clay"
    assert len(SOILS) == len(list(SOILS))
    assert scenario("flat", soil="red-clay").model.soils[0].k == 0.011


def test_an_experiment_is_found_by_name_and_by_its_file(installed, tmp_path):
    installed()
    assert installed_experiments()["joint"].__name__ == "Joint"
    data = tmp_path / "data"
    data.mkdir()
    (data / "joint.toml").touch()
    assert experiment_of_folder(data) == "joint"
    (data / "motor.toml").write_text("[motor]\ngear = 200\nk_t = 0.01\nresistance = 20\nsupply = 12\n")
    rows = ["run,duty,load_Nm,wheel_rate_radps,wheel_rate_sd_radps,current_A,current_sd_A"]
    normal = np.random.default_rng(0).normal
    for duty in (0.4, 0.6, 0.8, 1.0):
        for share in np.linspace(0.0, 0.4, 5):
            load = share * 1.2 * duty
            rate = (1.2 * duty - load) / (4.0 / 20.0)
            rows.append(f"{duty},{duty},{load},{rate + normal(0, 0.02)},0.02,{(12 * duty - 2 * rate) / 20},0.003")
    (data / "points.csv").write_text("\n".join(rows) + "\n")
    assert close_the_loop(data).kind == close_the_loop(data, experiment="motor_brake").kind


def test_list_states_where_each_comes_from(installed, run):
    installed()
    for what, name in (("effects", "ClayGrip"), ("soils", "red-clay"), ("experiments", "joint")):
        code, out, _ = run("list", what, "--json")
        assert code == 0
        packages = {entry["name"]: entry["package"] for entry in json.loads(out)[what]}
        assert packages.pop(name) == "clay-laws 1.2"
        assert set(packages.values()) == {"rover_pin"}
        _, out, _ = run("list", what)
        assert [line.split()[0] for line in out.splitlines() if "clay-laws 1.2" in line] == [name]


@pytest.mark.parametrize(
    ("code", "offers", "words"),
    [
        ("import no_such_module\n", OFFERS, "no_such_module"),
        ("raise ValueError('half written')\n", OFFERS, "half written"),
        ("from rover_pin import Soil\nSoil(phi=30.0)\n", OFFERS, "Soil.phi"),
        (CODE, {"rover_pin.effects": "ClayGrip = clay_laws:NoSuchClass"}, "NoSuchClass"),
        (CODE, {"rover_pin.effects": "ClayGrip = clay_laws:RedClay"}, "derives from"),
        (CODE, {"rover_pin.effects": "Clay = clay_laws:ClayGrip"}, "ClayGrip"),
        (CODE, {"rover_pin.effects": "SlipSinkage = clay_laws:ClayGrip"}, "rover_pin itself"),
        (CODE.replace('neutral: ClassVar[dict[str, float]] = {"a": 0.0}', ""), OFFERS, "neutral"),
    ],
)
def test_a_package_that_cannot_be_used_is_named_in_one_sentence(installed, code, offers, words):
    installed(code, offers)
    with pytest.raises(DataError, match=r"clay-laws 1\.2") as refused:
        refuse_unfit_offered_effects()
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_broken_soil_or_experiment_is_named_too(installed):
    installed("import no_such_module\n")
    for use in (lambda: SOILS["red-clay"], installed_experiments, soils, effects):
        with pytest.raises(DataError, match=r"clay-laws 1\.2.*no_such_module.*pip uninstall clay-laws"):
            use()
    # What the package itself has needs no other package.
    assert SOILS["table-1"].k > 0.0
    assert scenario("flat", duration=0.2).drive()["body_x"].size


def test_two_packages_with_one_name_are_both_named(installed):
    installed()
    installed(name="mud-laws", module="mud_laws")
    with pytest.raises(DataError, match=r"mud-laws 1\.2.*clay-laws 1\.2"):
        installed_effects()


def test_an_exception_in_its_law_states_file_and_line(installed):
    installed(CODE.replace("return Load(torque=self.a", "return Load(torque=self.missing"))
    model = having(scenario("flat").model, "ClayGrip")
    line = next(i for i, text in enumerate(CODE.splitlines(), 1) if "return Load" in text)
    with pytest.raises(DataError, match=rf"clay_laws\.py, line {line}: .*missing"):
        contact_law(model.contact_effects)


def test_the_working_folder_offers_nothing(tmp_path):
    """A folder of someone else that holds metadata of a package is data: its code does not run."""
    install(tmp_path, CODE + f"\nopen({str(tmp_path / 'ran')!r}, 'w')\n")
    environment = {**os.environ, "PYTHONPATH": ""}
    program = [sys.executable, "-m", "rover_pin", "list", "effects"]
    done = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert "ClayGrip" not in done.stdout
    assert not (tmp_path / "ran").exists()


HELP = "import sys; sys.argv = ['rover-pin', '--help']\nfrom rover_pin.cli.app import app\napp(standalone_mode=False)"


@pytest.mark.parametrize("code", ["import rover_pin", HELP])
def test_neither_the_import_nor_the_help_reads_the_installed_packages(code):
    loaded = f"{code}\nimport sys\nassert 'importlib.metadata' not in sys.modules"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    subprocess.run([sys.executable, "-c", loaded], check=True, capture_output=True, env=environment)


def test_a_drive_on_the_packages_own_soil_does_not_read_them_either():
    code = (
        "import sys\nfrom rover_pin import scenario\nscenario('flat', soil='dry-sand')\n"
        "assert 'importlib.metadata' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
