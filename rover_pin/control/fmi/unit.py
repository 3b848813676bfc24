"""A functional mock-up unit of FMI 3.0, for co-simulation: its variables, its description, and the file."""

import hashlib
import io
import math
import platform
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rover_pin import version
from rover_pin.base.files.paths import text_of_package
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.units import BASE, readings
from rover_pin.simulation.compiled.toolchain import portable_library
from rover_pin.simulation.native.shared import c_number

SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
MAIN = "unit.c"
"""The C file that has the unit's variable functions."""


@dataclass(frozen=True)
class Variable:
    """A variable of a unit, or an array of them: input, output or (tunable) parameter."""

    name: str
    unit: str
    causality: str
    start: tuple[float, ...]
    description: str
    low: float = -sys.float_info.max
    high: float = sys.float_info.max
    may_be_nan: bool = False

    @property
    def is_settable(self) -> bool:
        """Whether it is given from outside."""
        return self.causality != "output"


@dataclass(frozen=True)
class FunctionalUnit:
    """A unit: C files of which `unit.c` defines `Unit`, `unit_begin`, `unit_bind` and `unit_step` for `fmi3.c`."""

    name: str
    description: str
    period: float
    "of its steps [s]"
    variables: tuple[Variable, ...]
    sources: Mapping[str, str]

    @property
    def by_causality(self) -> dict[str, str]:
        """The names of its inputs, parameters and outputs."""
        kinds = dict.fromkeys(variable.causality for variable in self.variables)
        return {kind: ", ".join(entry.name for entry in self.variables if entry.causality == kind) for kind in kinds}

    @cached_property
    def c_files(self) -> dict[str, str]:
        """The C files, `fmi3.c` at the end of `unit.c`."""
        begins = np.cumsum([0, *(len(variable.start) for variable in self.variables)]).tolist()
        table = "\n".join(
            f"  {{{begin}, {len(variable.start)}, {int(variable.is_settable)}, {int(variable.may_be_nan)}, "
            f"{variable.low!r}, {variable.high!r}}}, /* {variable.name} */"
            for begin, variable in zip(begins, self.variables, strict=False)
        )
        start = ", ".join(c_number(float(value)) for variable in self.variables for value in variable.start)
        fmi = text_of_package("rover_pin.control.fmi", "fmi3.c")
        head = f"""
#include <math.h>
#define PERIOD {self.period!r}
#define TOKEN "{self.token}"
#define N_VARIABLES {len(self.variables)}u
static const struct {{ int first, count, settable, may_be_nan; double low, high; }} VARIABLES[] = {{
{table}
}};
static const double START[] = {{{start}}};
"""
        return {**self.sources, MAIN: self.sources[MAIN] + head + fmi}

    @cached_property
    def token(self) -> str:
        """The instantiation token: one for each content."""
        content = repr((self.name, self.period, self.variables, sorted(self.sources.items())))
        return f"{{{hashlib.sha256(content.encode()).hexdigest()[:32]}}}"

    @cached_property
    def description_xml(self) -> str:
        """The modelDescription.xml."""
        root = ET.Element(
            "fmiModelDescription",
            fmiVersion="3.0",
            modelName=self.name,
            instantiationToken=self.token,
            description=self.description,
            generationTool=f"rover-pin {version.__version__}",
            variableNamingConvention="structured",
        )
        ET.SubElement(
            root,
            "CoSimulation",
            modelIdentifier=self.name,
            canGetAndSetFMUState="true",
            canSerializeFMUState="true",
            fixedInternalStepSize=repr(self.period),
        )
        root.append(_units({variable.unit for variable in self.variables} | {"s"}))
        ET.SubElement(root, "DefaultExperiment", stepSize=repr(self.period))
        variables, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
        ET.SubElement(
            variables, "Float64", name="time", valueReference="0", causality="independent", variability="continuous",
            unit="s",
        )  # fmt: skip
        for at, variable in enumerate(self.variables, 1):
            variables.append(_variable_element(variable, at))
        for kind in ("Output", "InitialUnknown"):
            for at, variable in enumerate(self.variables, 1):
                if not variable.is_settable:
                    ET.SubElement(structure, kind, valueReference=str(at))
        return _text(root)

    @cached_property
    def build_xml(self) -> str:
        """The sources/buildDescription.xml: with it, a tool builds the unit for another system."""
        root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
        build = ET.SubElement(root, "BuildConfiguration", modelIdentifier=self.name)
        sources = ET.SubElement(build, "SourceFileSet", language="C11")
        for name in self.c_files:
            if name.endswith(".c"):
                ET.SubElement(sources, "SourceFile", name=name)
        return _text(root)


def write_unit(unit: FunctionalUnit, path: str | Path) -> Path:
    """Write an FMU: description, C sources, and the library for this system; return its path.

    Raises MissingExtraError: there is no C compiler.
    Raises DataError: the file cannot be written.
    """
    system, suffix = SYSTEMS[sys.platform]
    machine = platform.machine().lower()
    binary = f"binaries/{MACHINES.get(machine, machine)}-{system}/{unit.name}{suffix}"
    with tempfile.TemporaryDirectory() as folder:
        library = portable_library(unit.c_files, Path(folder)).read_bytes()
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        texts = {"modelDescription.xml": unit.description_xml, "sources/buildDescription.xml": unit.build_xml}
        texts |= {f"sources/{name}": text for name, text in unit.c_files.items()}
        for name, data in [*((name, text.encode()) for name, text in texts.items()), (binary, library)]:
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return replace_file(path, content.getvalue())


def _variable_element(variable: Variable, reference: int) -> ET.Element:
    entry = ET.Element(
        "Float64",
        name=variable.name,
        valueReference=str(reference),
        causality=variable.causality,
        variability="tunable" if variable.causality == "parameter" else "continuous",
        description=variable.description,
    )
    if variable.unit:
        entry.set("unit", variable.unit)
    for name, bound in (("min", variable.low), ("max", variable.high)):
        if abs(bound) < sys.float_info.max:
            entry.set(name, repr(bound))
    if variable.is_settable:
        entry.set("start", " ".join("NaN" if math.isnan(value) else repr(value) for value in variable.start))
    else:
        entry.set("initial", "calculated")
    if len(variable.start) > 1:
        ET.SubElement(entry, "Dimension", start=str(len(variable.start)))
    return entry


def _units(names: set[str]) -> ET.Element:
    root = ET.Element("UnitDefinitions")
    for name in sorted(names - {""}):
        reading = next(reading for reading in readings(name) if reading.size == 1)
        powers = {base: str(power) for base, power in zip(BASE, reading.powers, strict=True) if power}
        ET.SubElement(ET.SubElement(root, "Unit", name=name), "BaseUnit", powers)
    return root


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
