"""Print constraints.txt: every package that rover_pin, its extras and its tests need, with its version and a hash.

The versions are those that are installed in the environment in which this script runs, so that the file states what
was tested. pip finds the file of each version on the package index and reports its SHA-256; nothing is installed. The
hashes hold for the wheels of this platform (see the first line of the output). Another machine makes its own file:

    python .ci/lock.py > constraints.txt
"""

import json
import platform
import subprocess
import sys
import tempfile
import tomllib
from importlib.metadata import distributions
from pathlib import Path

from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]


def wanted() -> list[str]:
    """Return the requirements of pyproject.toml, with all extras and with what builds the package. The project itself
    is left out.
    """
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, build = document["project"], document["build-system"]["requires"]
    # Hatchling needs the package editables for `pip install -e`. Without build isolation, pip does not install either.
    lists = [build, ["editables"], project["dependencies"], *project["optional-dependencies"].values()]
    return sorted({line for lines in lists for line in lines if not line.startswith("rover-pin")})


def resolved() -> list[dict[str, object]]:
    """Return what pip would install: an entry of its report for each package, in the versions installed here."""
    with tempfile.TemporaryDirectory() as folder:
        versions, report = Path(folder, "versions.txt"), Path(folder, "report.json")
        pins = {f"{package.name}=={package.version}" for package in distributions() if package.name != "rover-pin"}
        versions.write_text("\n".join(sorted(pins)), encoding="utf-8")
        options = ["--quiet", "--dry-run", "--ignore-installed", "--prefer-binary"]
        files = ["--report", str(report), "--constraint", str(versions)]
        pip = [sys.executable, "-m", "pip", "install", *options, *files, *wanted()]
        subprocess.run(pip, check=True, stdout=sys.stderr)
        installs: list[dict[str, object]] = json.loads(report.read_text(encoding="utf-8"))["install"]
        return installs


def main() -> None:
    """Print one line for each package, sorted by name."""
    machine = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    print(f"# Made by `python .ci/lock.py` with {machine}. Use: pip install --require-hashes -r constraints.txt")
    lines = {}
    for entry in resolved():
        metadata, sha256 = entry["metadata"], entry["download_info"]["archive_info"]["hashes"]["sha256"]
        lines[canonicalize_name(metadata["name"])] = f"{metadata['version']} --hash=sha256:{sha256}"
    for name, line in sorted(lines.items()):
        print(f"{name}=={line}")


if __name__ == "__main__":
    main()
