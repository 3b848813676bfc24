"""The data layout that Python and C share is defined once: sizes and positions follow from the records."""

from __future__ import annotations

import dataclasses
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Soil
from rover_pin.simulation.native import shared

ROOT = Path(__file__).parents[2]
DRIVE = "from rover_pin import scenario; print(scenario('ditch', duration=8.0).drive()['body_x'].tolist())"


def places(text: str, table: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith("enum") and line.endswith(f" N_{table} }};")]
    return line.removeprefix("enum { ").removesuffix(f", N_{table} }};").split(", ")


def test_a_soil_with_one_quantity_more_moves_every_place_in_c(monkeypatch):
    fields = [
        (name, float, quantity(0.5, metadata.unit, metadata.source)) for name, metadata in quantities(Soil).items()
    ]
    fields.insert(2, ("density", float, quantity(1.6, "", "a test")))
    monkeypatch.setattr(shared, "Soil", dataclasses.make_dataclass("Soil", fields, bases=(Record,), frozen=True))
    assert places(shared.header(), "SOIL") == [f"SOIL_{name.upper()}" for name, *_ in fields]


@pytest.mark.slow
def test_additional_soil_quantity_does_not_change_a_drive(tmp_path):
    """The drive runs in a copy of the package whose `Soil` has another quantity before the exponent."""
    for name in ("rover_pin", "urdf"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    contact = tmp_path / "rover_pin" / "contact.py"
    text = contact.read_text(encoding="utf-8")
    before = "    c: Scalar = quantity("
    assert text.count(before) == 1
    more = '    density: Scalar = quantity(1600.0, "kg/m^3", "a test", 0.0, 1e4, "rho")\n'
    contact.write_text(text.replace(before, more + before), encoding="utf-8")
    tables = [
        subprocess.run(
            [sys.executable, "-c", DRIVE],
            env={**os.environ, "PYTHONPATH": str(package)},
            cwd=tmp_path,
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for package in (ROOT, tmp_path)
    ]
    assert tables[0] == tables[1]
    assert len(tables[0]) > 1000
