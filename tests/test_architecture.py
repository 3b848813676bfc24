"""The house rules that a reader relies on: which room may import which, no import cycles, public docstrings."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "rover_pin"
FILES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}

ROOMS = ("version", "base", "contact", "parameters", "soil", "effects", "terrain", "rover", "simulation", "logs",
         "control", "estimation", "inference", "measurements", "discrepancy", "experiments",
         "scenarios", "view", "report", "loop", "demo", "importing", "onboard", "plot", "sweep",
         "tuning", "comparison", "cli",
         "__main__")  # fmt: skip
"""From the bottom up: a room imports itself and what is below it."""
NO_ROVER = ("estimation", "inference", "discrepancy")
"""Rooms that know nothing of rovers, soils or files: what they work on is an abstract experiment."""
LEAVES = {"importing": ("cli",), "onboard": ("cli", "plot")}
"""Rooms through which data comes in or a model goes out, with the only rooms that may import them."""
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
    pairs = [(name, second) for name, others in OWN.items() for second in others - {"rover_pin"}]
    assert not [pair for pair in pairs if level[room(pair[1])] > level[room(pair[0])]]


def test_the_loop_itself_knows_no_rover():
    pairs = [(name, second) for name, others in OWN.items() if room(name) in NO_ROVER for second in others]
    assert not [pair for pair in pairs if room(pair[1]) not in (*NO_ROVER, "base")]


@pytest.mark.parametrize("leaf", LEAVES)
def test_leaves_are_imported_by_few(leaf):
    importers = {room(name) for name, others in OWN.items() for second in others if room(second) == leaf}
    assert importers <= {leaf, *LEAVES[leaf]}


def test_every_package_states_its_contents():
    assert all(ast.get_docstring(tree) for path, tree in FILES.items() if path.name == "__init__.py")


def test_nothing_inside_imports_the_front_door():
    assert not [name for name, local in OWN.items() if "rover_pin" in local]


def test_no_import_cycles():
    state = defaultdict(lambda: "new")

    def visit(name, way):
        assert state[name] != "open", "cycle: " + " -> ".join([*way[way.index(name) :], name])
        if state[name] == "new":
            state[name] = "open"
            for second in sorted(OWN.get(name, ())):
                visit(second, [*way, name])
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


def test_the_packages_own_names_are_there():
    import rover_pin

    for name in rover_pin.__all__:
        assert getattr(rover_pin, name) is not None
    assert set(rover_pin.__all__) <= set(dir(rover_pin))
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = rover_pin.simulat
