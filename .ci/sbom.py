"""Print the software bill of materials of rover_pin: the installed packages that it needs, as CycloneDX 1.5 JSON.

The list is read from the metadata of the packages of the environment in which this script runs. It contains rover-pin's
own requirements, their requirements, and so on; packages that are installed for other reasons are left out. The output
depends on the environment only, not on the time.
"""

import json
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name


def requirements(package: Distribution, extras: frozenset[str]) -> set[tuple[str, frozenset[str]]]:
    """Return the packages that a package needs on this platform with some of its extras: name and extras of each."""
    needed = set()
    for line in package.requires or ():
        one = Requirement(line)
        if one.marker is None or any(one.marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            needed.add((canonicalize_name(one.name), frozenset(one.extras)))
    return needed


def licence(metadata: dict[str, object]) -> list[dict[str, object]]:
    """Return the licence of a package: its SPDX expression, otherwise the name that it states, if it is short."""
    if expression := metadata.get("license_expression"):
        return [{"expression": expression}]
    classifiers = [str(line).split(" :: ")[-1] for line in metadata.get("classifier", ()) if "License ::" in str(line)]
    names = classifiers or [str(metadata.get("license", ""))]
    return [{"license": {"name": name}} for name in names if name and "\n" not in name and len(name) < 80]


def bill(root: str) -> dict[str, object]:
    """Return the bill of materials of an installed package and of everything that it needs.

    A requirement that is not installed, such as one for another platform, is left out.
    """
    waiting, packages, edges = [(root, frozenset())], {}, {}
    seen = set(waiting)
    while waiting:
        name, extras = waiting.pop()
        try:
            packages[name] = distribution(name)
        except PackageNotFoundError:
            continue
        needed = requirements(packages[name], extras)
        edges.setdefault(name, set()).update(other for other, _ in needed)
        waiting += needed - seen
        seen |= needed
    references = {name: f"pkg:pypi/{name}@{package.version}" for name, package in packages.items()}
    components = {
        name: {"type": "library", "bom-ref": references[name], "name": name, "version": package.version,
               "purl": references[name], "licenses": licence(package.metadata.json)}
        for name, package in sorted(packages.items())
    }  # fmt: skip
    main = components.pop(root) | {"type": "application"}
    dependencies = [
        {"ref": references[name], "dependsOn": sorted(references[other] for other in edges[name] if other in packages)}
        for name in sorted(packages)
    ]
    return {
        "bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1, "metadata": {"component": main},
        "components": list(components.values()), "dependencies": dependencies,
    }  # fmt: skip


if __name__ == "__main__":
    json.dump(bill("rover-pin"), sys.stdout, indent=1)
    print()
