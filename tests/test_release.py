"""What belongs to a release: the bill of materials, the locked versions, the container and the citation."""

import json
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from rover_pin import __version__

ROOT = Path(__file__).parents[1]
DOCUMENT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT, BUILD = DOCUMENT["project"], DOCUMENT["build-system"]["requires"]
LOCKED = [line for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]


def test_the_bill_of_materials_has_every_package_that_is_needed():
    made = subprocess.run([sys.executable, ".ci/sbom.py"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    bill = json.loads(made)
    assert (bill["bomFormat"], bill["metadata"]["component"]["version"]) == ("CycloneDX", __version__)
    versions = {one["name"]: one["version"] for one in bill["components"]}
    for need in map(Requirement, PROJECT["dependencies"]):
        assert versions[canonicalize_name(need.name)] == version(need.name)
    # A package of the development environment that the package itself does not need is not in it.
    assert not {"pytest", "ruff", "mypy"} & set(versions)
    references = {one["bom-ref"] for one in (bill["metadata"]["component"], *bill["components"])}
    assert references == {one["ref"] for one in bill["dependencies"]}
    assert references >= {ref for one in bill["dependencies"] for ref in one["dependsOn"]}
    # numpy is needed by the package itself, and urdfdom only through pinocchio.
    needs = {one["ref"].split("@")[0]: {ref.split("@")[0] for ref in one["dependsOn"]} for one in bill["dependencies"]}
    assert "pkg:pypi/numpy" in needs["pkg:pypi/rover-pin"]
    assert "pkg:pypi/cmeel-urdfdom" not in needs["pkg:pypi/rover-pin"]
    assert "cmeel-urdfdom" in versions


def test_each_locked_version_has_a_hash_and_is_allowed():
    locked = dict(re.fullmatch(r"([a-z0-9-]+)==(\S+) --hash=sha256:[0-9a-f]{64}", line).groups() for line in LOCKED)
    assert len(locked) == len(LOCKED)
    needs = [*PROJECT["dependencies"], *(line for lines in PROJECT["optional-dependencies"].values() for line in lines)]
    # Without build isolation, pip does not install what builds the package; hatchling needs editables for `-e`.
    for need in map(Requirement, [*needs, *BUILD, "editables"]):
        if need.name != PROJECT["name"]:
            assert need.specifier.contains(locked[canonicalize_name(need.name)]), need


def test_the_container_runs_the_lines_of_the_readme():
    lines = [
        subprocess.run(
            [sys.executable, ".ci/printed.py", "README.md", heading],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.splitlines()[0]
        for heading in ("Install", "Five minutes")
    ]
    runs = re.findall(r"^RUN (.*)", (ROOT / "Dockerfile").read_text(encoding="utf-8"), re.MULTILINE)
    assert runs[-2:] == lines


def test_the_citation_has_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [__version__]


@pytest.mark.parametrize("which", ["", "oldest"])
def test_the_script_for_other_versions_refuses_an_unknown_word(which):
    ran = subprocess.run([".ci/versions", which], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "locked|lowest|newest" in ran.stderr
