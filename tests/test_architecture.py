"""The house rules that a reader relies on: which room may import which, no cycles, docstrings, short files."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rover_pin"
FILES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
STUDIES = sorted((ROOT / "studies").rglob("*.py"))
LONGEST = 300

ROOMS = ("version", "base", "contact", "parameters", "soil", "effects", "terrain", "rover", "simulation", "logs",
         "control", "estimation", "inference", "measurements", "discrepancy", "experiments",
         "scenarios", "view", "report", "loop", "demo", "plot", "sweep", "tuning", "comparison", "cli",
         "__main__")  # fmt: skip
"""From the bottom up: a room imports itself and what is below it."""
BUDGETS = {"base": 2697, "parameters": 337, "soil": 997, "effects": 2321, "terrain": 1509, "rover": 3785,
           "simulation": 7559, "logs": 3816, "control": 5223, "estimation": 1924, "inference": 2057,
           "measurements": 1987, "discrepancy": 1932, "experiments": 8159, "scenarios": 1226,
           "view": 1162, "report": 2283, "loop": 1194, "demo": 353, "plot": 949, "sweep": 1199, "tuning": 2244,
           "comparison": 840, "cli": 1792}  # fmt: skip
"""Lines that a room may have. One that is full is made simpler, or its budget is argued for in the same change."""
NO_ROVER = ("estimation", "inference", "discrepancy")
"""Rooms that know nothing of rovers, soils or files: what they work on is an abstract experiment."""
FOREIGN = {"parameters": "pinocchio", "soil": "pinocchio", "effects": "pinocchio", "terrain": "casadi",
           "rover": "casadi"}  # fmt: skip
"""What a room never imports itself. (casadi comes to rover through quantity, which must know an expression.)"""


def module(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module(path): path for path in FILES}


def room(name):
    return name.split(".")[1]


def imports(tree):
    """Yield the modules that a file imports anywhere, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else node.module


INSIDE = [path for path in FILES if path != PACKAGE / "__init__.py"]
OWN = {module(path): {name for name in imports(FILES[path]) if name.split(".")[0] == "rover_pin"} for path in INSIDE}


def test_every_module_is_in_a_room_and_every_room_is_there():
    assert {room(name) for name in OWN} == set(ROOMS)


def test_rooms_import_downwards():
    level = {name: i for i, name in enumerate(ROOMS)}
    pairs = [(name, other) for name, others in OWN.items() for other in others - {"rover_pin"}]
    assert not [pair for pair in pairs if level[room(pair[1])] > level[room(pair[0])]]


def test_the_loop_itself_knows_no_rover():
    pairs = [(name, other) for name, others in OWN.items() if room(name) in NO_ROVER for other in others]
    assert not [pair for pair in pairs if room(pair[1]) not in (*NO_ROVER, "base")]


ONE_IDEA_A_FILE = ("effects",)
"""Rooms that grow by one file for each thing they hold."""
FOLDERS = sorted(
    {path.parent for path in FILES if path.parent not in (PACKAGE, *(PACKAGE / r for r in ONE_IDEA_A_FILE))}
)
MOST_FILES = 16


@pytest.mark.parametrize("name", BUDGETS)
def test_a_room_keeps_to_its_budget(name):
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in (PACKAGE / name).rglob("*.py"))
    assert lines <= BUDGETS[name], f"{name} has {lines} lines: make it simpler, or argue for its budget"


def test_every_folder_has_a_budget():
    assert {path.parent.relative_to(PACKAGE).parts[0] for path in FILES if path.parent != PACKAGE} == set(BUDGETS)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_is_seen_at_one_look(folder):
    stems = [path.stem for path in folder.glob("*.py") if path.stem != "__init__"]
    assert len(stems) <= MOST_FILES, f"{folder.name} has {len(stems)} files: give some a room of their own"
    assert not [stem for stem in stems if stem.startswith(f"{folder.name}_")], "no file repeats the name of its room"
    assert ast.get_docstring(FILES[folder / "__init__.py"]), f"{folder.name}/__init__.py says what is inside"


def test_nothing_inside_imports_the_front_door():
    assert not [name for name, own in OWN.items() if "rover_pin" in own]


def test_no_import_cycles():
    state = defaultdict(lambda: "new")

    def visit(name, way):
        assert state[name] != "open", "cycle: " + " -> ".join([*way[way.index(name) :], name])
        if state[name] == "new":
            state[name] = "open"
            for other in sorted(OWN.get(name, ())):
                visit(other, [*way, name])
            state[name] = "done"

    for name in OWN:
        visit(name, [])


@pytest.mark.parametrize(("place", "foreign"), FOREIGN.items())
def test_numbers_and_symbols_stay_in_their_rooms(place, foreign):
    guilty = [
        module(path)
        for path in INSIDE
        if room(module(path)) == place and any(name.split(".")[0] == foreign for name in imports(FILES[path]))
    ]
    assert not guilty, f"{foreign} in {place}/"


def undocumented(tree):
    """Yield the public module, classes, functions and methods that lack a docstring."""
    if ast.get_docstring(tree) is None:
        yield "the module"
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.name.startswith("_"):
            if ast.get_docstring(node) is None:
                yield node.name
            for member in node.body if isinstance(node, ast.ClassDef) else ():
                named = isinstance(member, ast.FunctionDef) and (member.name == "__call__" or member.name[0] != "_")
                if named and ast.get_docstring(member) is None:
                    yield f"{node.name}.{member.name}"


def test_what_is_public_has_a_docstring():
    assert not [(module(path), name) for path, tree in FILES.items() for name in undocumented(tree)]


def test_files_are_short():
    lines = {path.relative_to(ROOT): len(path.read_text(encoding="utf-8").splitlines()) for path in [*FILES, *STUDIES]}
    assert not {name: count for name, count in lines.items() if count >= LONGEST}


def test_the_packages_own_names_are_there():
    import rover_pin

    for name in rover_pin.__all__:
        assert getattr(rover_pin, name) is not None
    assert set(rover_pin.__all__) <= set(dir(rover_pin))
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = rover_pin.simulat
