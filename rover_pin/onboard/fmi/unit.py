"""A functional mock-up unit (FMU) of FMI 3.0 for co-simulation: its variables, its descriptions in XML, and its file.

`controller.py` makes the unit of a control, and `plant.py` makes the unit of a rover on its ground. `fmi3.c` contains
the functions that the standard prescribes.
"""

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
from rover_pin.base.encode import c_comment, xml_text
from rover_pin.base.files.paths import text_of_package
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.units import BASE, readings
from rover_pin.simulation.compiled.toolchain import portable_library
from rover_pin.simulation.native.shared import c_number

SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
"""Name of a platform in Python -> name of its operating system in FMI, and suffix of its shared libraries."""
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
"""Name of a processor in Python -> its name in FMI. A processor that has the same name in both is not listed."""
MAIN = "unit.c"
"""Name of the C file that defines the functions of a unit that `fmi3.c` calls."""


@dataclass(frozen=True)
class Variable:
    """An input, an output or a tunable parameter of a functional mock-up unit. The variable is an array if it has
    several start values.
    """

    name: str
    unit: str
    """unit of measurement, for example `rad/s`; empty for a number without unit"""
    causality: str
    "`input`, `output` or `parameter`"
    start: tuple[float, ...]
    "start values"
    description: str
    low: float = -sys.float_info.max
    """smallest allowed value of the variable"""
    high: float = sys.float_info.max
    """largest allowed value of the variable"""
    may_be_nan: bool = False
    """whether the variable may be set to NaN, for a measurement that is missing"""

    @property
    def is_settable(self) -> bool:
        """Whether a simulator may set the variable, which is so for inputs and parameters."""
        return self.causality != "output"


@dataclass(frozen=True)
class FunctionalUnit:
    """A functional mock-up unit: its variables and its C code. `write_unit` writes the unit to a file.

    The C file `unit.c` defines the type `Unit` and the functions `unit_begin`, `unit_bind` and `unit_step`, which are
    called by the functions of the FMI standard in `fmi3.c`.
    """

    name: str
    "name of the unit and of its library"
    description: str
    "one line about the unit, for its user"
    period: float
    "length of its steps [s]"
    variables: tuple[Variable, ...]
    "the variables, in the order of their values in C"
    sources: Mapping[str, str]
    """name of a C file -> its text"""

    @property
    def by_causality(self) -> dict[str, str]:
        """The names of the unit's inputs, of its parameters and of its outputs: causality -> names, separated by
        commas.
        """
        kinds = dict.fromkeys(variable.causality for variable in self.variables)
        return {kind: ", ".join(entry.name for entry in self.variables if entry.causality == kind) for kind in kinds}

    @cached_property
    def c_files(self) -> dict[str, str]:
        """The texts of all C files of the unit, by the name of the file. In `unit.c`, the text of `fmi3.c` follows the
        functions of this unit.
        """
        # A table tells the functions of the standard where the values of each variable are, and what may be set.
        begins = np.cumsum([0, *(len(variable.start) for variable in self.variables)]).tolist()
        table = "\n".join(
            f"  {{{begin}, {len(variable.start)}, {int(variable.is_settable)}, {int(variable.may_be_nan)}, "
            f"{variable.low!r}, {variable.high!r}}}, /* {c_comment(variable.name)} */"
            for begin, variable in zip(begins, self.variables, strict=False)
        )
        start = ", ".join(c_number(float(value)) for variable in self.variables for value in variable.start)
        fmi = text_of_package("rover_pin.onboard.fmi", "fmi3.c")
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
        """The instantiation token, a digest of the unit's content, which lets a simulator distinguish units."""
        content = repr((self.name, self.period, self.variables, sorted(self.sources.items())))
        return f"{{{hashlib.sha256(content.encode()).hexdigest()[:32]}}}"

    @cached_property
    def description_xml(self) -> str:
        """The text of modelDescription.xml, with the variables, their units and the step size."""
        root = ET.Element(
            "fmiModelDescription",
            fmiVersion="3.0",
            modelName=self.name,
            instantiationToken=self.token,
            description=xml_text(self.description),
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
        # Each unit is defined by its powers of the base units of SI.
        definitions = ET.SubElement(root, "UnitDefinitions")
        for name in sorted(({variable.unit for variable in self.variables} | {"s"}) - {""}):
            reading = next(reading for reading in readings(name) if reading.size == 1)
            powers = {base: str(power) for base, power in zip(BASE, reading.powers, strict=True) if power}
            ET.SubElement(ET.SubElement(definitions, "Unit", name=name), "BaseUnit", powers)
        ET.SubElement(root, "DefaultExperiment", stepSize=repr(self.period))
        variables, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
        ET.SubElement(
            variables, "Float64", name="time", valueReference="0", causality="independent", variability="continuous",
            unit="s",
        )  # fmt: skip
        # The value reference 0 is the time, 1 and above are the variables.
        for reference, variable in enumerate(self.variables, 1):
            element = ET.SubElement(
                variables,
                "Float64",
                name=variable.name,
                valueReference=str(reference),
                causality=variable.causality,
                variability="tunable" if variable.causality == "parameter" else "continuous",
                description=xml_text(variable.description),
            )
            if variable.unit:
                element.set("unit", variable.unit)
            for name, bound in (("min", variable.low), ("max", variable.high)):
                if abs(bound) < sys.float_info.max:
                    element.set(name, repr(bound))
            # The standard wants a start value for a variable that can be set, and `initial` for one that the unit
            # computes.
            if variable.is_settable:
                element.set("start", " ".join("NaN" if math.isnan(value) else repr(value) for value in variable.start))
            else:
                element.set("initial", "calculated")
            if len(variable.start) > 1:
                ET.SubElement(element, "Dimension", start=str(len(variable.start)))
        for kind in ("Output", "InitialUnknown"):
            for reference, variable in enumerate(self.variables, 1):
                if not variable.is_settable:
                    ET.SubElement(structure, kind, valueReference=str(reference))
        return _xml_text(root)

    @cached_property
    def build_xml(self) -> str:
        """The text of sources/buildDescription.xml, so that a tool can build the unit for another system."""
        root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
        build = ET.SubElement(root, "BuildConfiguration", modelIdentifier=self.name)
        sources = ET.SubElement(build, "SourceFileSet", language="C11")
        for name in self.c_files:
            if name.endswith(".c"):
                ET.SubElement(sources, "SourceFile", name=name)
        return _xml_text(root)


def write_unit(unit: FunctionalUnit, path: str | Path) -> Path:
    """Write a functional mock-up unit to a file (.fmu). Return the path of the file.

    The file contains the description of the unit, its C sources, and its compiled library for this operating system.

    Raises MissingExtraError: there is no C compiler. Raises DataError: the file cannot be written.
    """
    # The name of the folder of a library is prescribed by FMI: processor and operating system.
    system, suffix = SYSTEMS[sys.platform]
    machine = platform.machine().lower()
    binary = f"binaries/{MACHINES.get(machine, machine)}-{system}/{unit.name}{suffix}"
    with tempfile.TemporaryDirectory() as folder:
        library = portable_library(unit.c_files, Path(folder)).read_bytes()
    # Entries get a fixed date, so that equal units give equal files.
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        texts = {"modelDescription.xml": unit.description_xml, "sources/buildDescription.xml": unit.build_xml}
        texts |= {f"sources/{name}": text for name, text in unit.c_files.items()}
        for name, data in [*((name, text.encode()) for name, text in texts.items()), (binary, library)]:
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return replace_file(path, content.getvalue())


def _xml_text(root: ET.Element) -> str:
    """Return the text of an XML document whose root element is `root`."""
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
