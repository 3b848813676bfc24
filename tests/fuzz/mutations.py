"""Changes of a valid input: of bytes, of text, and of what a TOML, CSV, XML, npz or Parquet file holds."""

import copy
import datetime
import io
import json
import random
import tomllib
import xml.etree.ElementTree as ET

import numpy as np
import pyarrow
import pyarrow.parquet

DEEP = {"value": {"value": {"value": {"unit": "m"}}}}
VALUES = (
    *("", " ", "x", "nan", "-inf", "1e400", "0x10", "1,5", "\u202eabc", "m\u00fcll\nzwei", "a" * 3000),
    *("[red]x[/red]", "[/b]", "..", "/"),
    *(True, False, 0, -1, 3, 10**25, -(10**400), 0.5, -0.0, 1e-320, 1e9, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf"), [], [1, "a"], [[[]]], [None], {}, DEEP),
    *({"value": "x"}, {"value": [1.0]}),
    *({"value": 1.0, "unit": 3}, {"value": 1.0, "unit": "furlong"}, {"unit": "m"}, {"value": True, "unit": "m"}),
    *(datetime.date(2026, 1, 1), datetime.datetime(2026, 1, 1, 12), datetime.time(12)),
)  # fmt: skip
"""What stands in place of a good value: other types, other sizes, what looks like a number and what breaks a line."""
KEYS = ("", "value", "unit", "kind", "\u00e4", "a.b", "x" * 300, "[b]", "k_1", "file", "low")
CELLS = (
    "80 N",
    "n/a",
    "1,5",
    "much",
    "x" * 300,
    "\u4f4d\u7f6e",
    "",
    "nan",
    "inf",
    "-1e308",
    "1e400",
    "x",
    "1;5",
    '"',
    '"a,b"',
    "0x1f",
    "1_0",
    "\u0663",
    "-",
    "1e-320",
    "\x00",
)
NOISE = (b"\x00", b"\xff\xfe", b"\n", b"\r", "\u2028".encode(), b"[", b"]]", b'"', b"'''", b"=", b"<!--", b"&x;")
FLOODS = (
    *(b"," * 40, b"{" * 2000, b"x = " + b"[" * 9000, b"," * 300_000, b"a." * 20_000 + b"a = 1", b"\n" * 100_000),
    *(b"1 " * 100_000, b"<a>" * 20_000, b"'" * 9000, b"0" * 9000, b"\x93NUMPY\x01\x00"),
)
"""Many of one mark: what a reader builds of them must stay small."""


def mutated(name: str, content: bytes, rng: random.Random) -> bytes:
    """Return the content of a file changed in the way of its kind, or as any bytes."""
    kinds = {
        "toml": _toml, "csv": _csv, "urdf": _xml, "xacro": _xml, "dae": _xml, "npz": _npz, "npy": _npy, "mat": _mat,
        "png": _png, "asc": _esri, "json": _json, "parquet": _parquet, "py": _python,
    }  # fmt: skip
    mutators = kinds.get(name.rpartition(".")[2])
    changed = content
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        change = mutators if mutators is not None and rng.random() < 0.75 else _bytes
        try:
            changed = change(changed, rng)
        except Exception:  # a change of what an earlier change has broken
            changed = _bytes(changed, rng)
    return changed


def mutated_words(words: list[str], rng: random.Random) -> list[str]:
    """Return words of a command line with some left out, doubled, or with another value."""
    words = list(words)
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(words))
        way = rng.randrange(5)
        if way == 0:
            del words[at]
        elif way == 1:
            words.insert(at, rng.choice(words))
        else:
            name, sign, _ = words[at].partition("=")
            value = str(rng.choice(VALUES)).replace("\x00", "")
            words[at] = f"{name}{sign}{value}" if sign and way < 4 else value
        words = words or ["--set"]
    return words


def _bytes(content: bytes, rng: random.Random) -> bytes:
    at, to = sorted((rng.randint(0, len(content)), rng.randint(0, len(content))))
    noise = rng.choice(NOISE + FLOODS)
    flipped = bytearray(content)
    for _ in range(rng.choice((1, 3, 30)) if content else 0):
        flipped[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return rng.choice(
        (
            bytes(flipped),
            content[:at],
            content[:at] + content[to:],
            content[:at] + noise + content[at:],
            content[:to] + content[at:],
            rng.choice((b"", noise, content[::-1])),
        )
    )


def _toml(content: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.2:
        return _lines(content, rng)
    table = tomllib.loads(content.decode())
    _change_node(table, rng)
    return dumped(table).encode()


def _lines(content: bytes, rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    at = rng.randrange(len(lines))
    way = rng.randrange(3)
    lines[at : at + 1] = ([], [lines[at]] * 2, [rng.choice(lines)])[way]
    return b"\n".join(lines)


def _nodes(node: object) -> list:
    """Return every table and list that holds something."""
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    this_node = [node] if isinstance(node, (dict, list)) and node else []
    return this_node + [node for value in inner for node in _nodes(value)]


def _change_node(tree: object, rng: random.Random) -> None:
    """Rename, remove, double or replace one entry somewhere in a tree of tables and lists."""
    node = rng.choice(_nodes(tree))
    at = rng.choice(list(node) if isinstance(node, dict) else range(len(node)))
    way, value = rng.randrange(8), copy.deepcopy(rng.choice(VALUES))
    if way == 0:
        del node[at]
    elif way == 1 and isinstance(node, dict):
        name = rng.choice((*KEYS, at[:-1] or "q", at + "s", at.upper()))
        node[name] = node.pop(at)
    elif way == 2 and isinstance(node, dict):
        node[rng.choice(KEYS)] = value
    elif way == 2:
        node.insert(at, copy.deepcopy(node[at]))
    elif way == 3:
        node[at] = rng.choice(([node[at]], {"value": node[at]}, str(node[at])))
    elif way == 4 and isinstance(node[at], (int, float)) and not isinstance(node[at], bool):
        node[at] = node[at] * rng.choice((-1.0, 1e-3, 1e3, 1e9, 1e-9, 57.3, 100.0))
    else:
        node[at] = value


def dumped(table: dict) -> str:
    """Return a table as TOML whose values are written inline: it can write what the package's writer refuses."""
    return "".join(f"{_quoted(name)} = {_inline(value)}\n" for name, value in table.items())


def _inline(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(name)} = {_inline(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_inline(inner) for inner in value) + "]"
    return str(value).lower() if value is not None else '""'


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=True).replace("\x7f", "\\u007f")


def _csv(content: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.3:
        return _everyday(content, rng)
    mark = ";" if b";" in content else ","
    rows = [line.split(mark) for line in content.decode().split("\n")]
    at = rng.choice((0, rng.randrange(len(rows))))
    cell = rng.randrange(len(rows[at]))
    way = rng.randrange(9)
    if way == 0:
        rows[at].pop(cell)
    elif way == 1:
        rows[at][cell] = rows[at][cell - 1]
    elif way == 2:
        for row in rows:
            row[cell : cell + 1] = []
    elif way == 3:
        rows.insert(at, rows[at][:])
    elif way == 4:
        rng.shuffle(rows)
    elif way == 5:
        factor = rng.choice((-1.0, 0.0, 1e-3, 1e3, 57.3, 1e12))
        for row in rows[1:]:
            row[cell : cell + 1] = [_scaled(number, factor) for number in row[cell : cell + 1]]
    else:
        rows[at][cell] = rng.choice(CELLS)
    return "\n".join(mark.join(row) for row in rows).encode()


LAYOUTS = ((",", ";"), (";", ","), (",", "\t"), (".", ","), (";", " "), ("\n", "\r\n"), ("\n", "\n\n"), (",", '","'))
NAMES = ("\u65f6\u95f4", "x" * 300, "t", "sec", "nanosec", "time [h]", "---", "1", "Slip (%)", "x.y[0]", "[N]")
BEFORE = ("sep=;\n", "\ufeff", "# made by us\n", "\n\n", "a,b,c\n", "[-],[N],[m]\n", "PK\x03\x04")


def _everyday(content: bytes, rng: random.Random) -> bytes:
    """Return a table as another program writes it."""
    text, way = content.decode(), rng.randrange(4)
    if way == 0:
        return text.replace(*rng.choice(LAYOUTS)).encode()
    if way == 1:
        return (rng.choice(BEFORE) + text).encode(rng.choice(("utf-8", "utf-16", "cp1252")), errors="replace")
    lines = text.split("\n")
    mark = ";" if ";" in text else ","
    if way == 2:
        lines.insert(1, mark.join(rng.choice(("-", "N", "[mm]", "", "m/s")) for _ in lines[0].split(mark)))
        return "\n".join(lines).encode()
    at = rng.randrange(min(3, len(lines)))
    row = lines[at].split(mark)
    row[rng.randrange(len(row))] = rng.choice(NAMES)
    lines[at] = mark.join(row)
    return "\n".join(lines).encode()


STATEMENTS = (
    *("raise KeyError('x')", "raise SystemExit(3)", "return None", "return [1, 2]", "return 'x'", "import nothing"),
    *("return self", "yield 1", "assert False", "x = [][0]", "1 / 0", "return 1.0", "return (1,)", "del self"),
    *("raise GeneratorExit", "raise KeyboardInterrupt", "raise RecursionError('deep')", "raise MemoryError()"),
    *(
        "raise StopIteration",
        "import sys; sys.exit(7)",
        "(lambda f: f(f))(lambda f: f(f))",
        "raise ExceptionGroup('x', [OSError()])",
    ),
    *(
        "raise OSError(5, 'no such device')",
        "raise UnicodeDecodeError('utf-8', b'x', 0, 1, 'why')",
        "import os; os.chdir('/')",
    ),
    *("raise BaseException('two\\nlines')", "return float('nan')", "nonlocal x", "global np; np = None"),
)
TOKENS = (
    *(("self", "sel"), ("(", ""), (":", ""), ("return", "retrun"), ("0", "[]"), ("1", "'1'"), ("np.", "ca.")),
    *(("float", "str"), ("frozen=True", ""), ("@", "# @"), ("2", "-2"), ("x[0]", "x[7]"), ("path", "None")),
    ("Effect)", "object)"),
)


def _python(content: bytes, rng: random.Random) -> bytes:
    """Return code with a statement put before one, a line gone or doubled, or a word changed."""
    lines, way = content.decode().split("\n"), rng.randrange(4)
    at = rng.randrange(len(lines))
    if way == 0:
        indent = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
        lines.insert(at, indent + rng.choice(STATEMENTS))
    elif way == 1:
        lines[at : at + 1] = [[], lines[at : at + 1] * 2][rng.randrange(2)]
    else:
        able = [(k, pair) for k, line in enumerate(lines) for pair in TOKENS if pair[0] in line]
        at, pair = rng.choice(able)
        lines[at] = lines[at].replace(*pair, 1)
    return "\n".join(lines).encode()


def _scaled(cell: str, factor: float) -> str:
    try:
        return repr(factor * float(cell))
    except ValueError:
        return cell


ET.register_namespace("xacro", "http://www.ros.org/wiki/xacro")


def _xml(content: bytes, rng: random.Random) -> bytes:
    root = ET.fromstring(content)
    parent = rng.choice([element for element in root.iter() if len(element)])
    child = rng.choice(list(parent))
    way = rng.randrange(6)
    if way == 0:
        parent.remove(child)
    elif way == 1:
        parent.append(copy.deepcopy(child))
    elif way == 2:
        parent.remove(child)
        rng.choice(list(root.iter())).append(child)
    elif way == 3:
        child.tag = rng.choice((child.tag + "s", "link", "geometry", "joint", "mesh", "box", "xacro:if"))
    else:
        _change_attribute(rng.choice([element for element in root.iter() if element.attrib]), rng)
    return ET.tostring(root)


def _change_attribute(element: ET.Element, rng: random.Random) -> None:
    name = rng.choice(list(element.attrib))
    if rng.random() < 0.2:
        del element.attrib[name]
        return
    numbers = (" ".join(rng.choice(("0", "1", "-1", "1e5", "nan", "1e-9")) for _ in range(3)), "1e308", "-1", "0")
    texts = ("", "x", "1 2", "\u00e4", "base", "fixed", "planar", "floating", "prismatic", "[b]", "a\nb")
    element.set(name, rng.choice(numbers + texts))


ARRAYS = (
    lambda a: a.astype(str),
    lambda a: np.full_like(a, np.nan, dtype=float),
    lambda a: a.astype(complex),
    lambda a: a[..., None],
    lambda a: np.zeros((0, *a.shape[1:])) if a.ndim else np.zeros(0),
    lambda a: np.array(["x", 1.0], dtype=object),
    lambda a: -1e9 * a,
    lambda a: np.array(np.datetime64("2026-01-01")),
    lambda a: a.T[..., :1],
    lambda a: a.astype([("f", float)]),
    lambda a: a > 0,
)


SHAPES = ((0, 3), (3, 0), (0,), (1 << 40, 1 << 40), (-1, 3), (2,), (1, 1, 1), (3, 1 << 20), (1 << 31,), ())
DTYPES = ("<f8", "|O", "|S3", "<U9", "<c16", "|b1", ">f4", "<M8[ns]", "|V8", "[('a', '<f8')]", "<f2", "<i8")
HEIGHTS = (1e20, -9999.0, np.nan, np.inf, 1e308, 32767.0, -1e-320, 5.0)


def _npy(content: bytes, rng: random.Random) -> bytes:
    """Return an array of another type, shape or with strange heights, or the same numbers under a header that lies."""
    array, buffer = np.load(io.BytesIO(content)), io.BytesIO()
    way = rng.randrange(3)
    if way == 0:
        header = {"descr": rng.choice(DTYPES), "fortran_order": rng.random() < 0.3, "shape": rng.choice(SHAPES)}
        np.lib.format.write_array_header_1_0(buffer, header)
        return buffer.getvalue() + array.tobytes()
    if way == 1:
        array = rng.choice(ARRAYS)(array)
    else:
        array = array.astype(float)
        array.flat[[rng.randrange(array.size) for _ in range(rng.choice((1, 3, array.size)))]] = rng.choice(HEIGHTS)
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def _mat(content: bytes, rng: random.Random) -> bytes:
    """Return a .mat of other arrays, nested, of other versions, or with what holds no numbers."""
    from scipy.io import loadmat, savemat

    table = {name: value for name, value in loadmat(io.BytesIO(content)).items() if not name.startswith("__")}
    name = rng.choice(list(table))
    others = (
        *("text", ["a", "b"], {"x": table[name]}, {}, np.array(["a", 1.0], dtype=object), np.zeros((0, 3)), np.nan),
        *(np.arange(3.0), np.array([[1 + 2j]]), np.zeros((2, 2, 2)), True, {"a": {"b": {"c": np.arange(40.0)}}}),
    )
    table[rng.choice((name, "other"))] = rng.choice(others)
    buffer = io.BytesIO()
    try:
        savemat(buffer, table, format=rng.choice(("5", "5", "4")), do_compression=rng.random() < 0.5)
    except (TypeError, ValueError):  # what version 4 cannot hold
        savemat(buffer, table)
    return buffer.getvalue()


def _png(content: bytes, rng: random.Random) -> bytes:
    """Return a picture of another mode or size, or with a head that states another one."""
    from PIL import Image

    way, buffer = rng.randrange(3), io.BytesIO()
    if way == 0:
        at = rng.choice((16, 20, 24, 25, 28))
        return content[:at] + bytes(rng.randrange(256) for _ in range(4)) + content[at + 4 :]
    with Image.open(io.BytesIO(content)) as image:
        changed = (
            image.convert(rng.choice(("1", "L", "RGB", "RGBA", "LA", "P")))
            if way == 1
            else image.resize((rng.choice((1, 2, 300)), rng.choice((1, 2, 300))))
        )
        changed.save(buffer, format="png")
    return buffer.getvalue()


def _esri(content: bytes, rng: random.Random) -> bytes:
    """Return a grid with another word somewhere, most often in its head."""
    words = content.decode().split(" ")
    at = rng.choice((rng.randrange(min(12, len(words))), rng.randrange(len(words))))
    words[at] = rng.choice((*CELLS, "-9999", "1e20", "ncols", "100000", "NODATA_value", "\n", *(["0.02"] * 6)))
    return " ".join(words).encode()


def _npz(content: bytes, rng: random.Random) -> bytes:
    with np.load(io.BytesIO(content)) as file:
        arrays = {name: file[name] for name in file.files}
    name, way = rng.choice(list(arrays)), rng.randrange(4)
    if way == 0:
        del arrays[name]
    elif way == 1:
        arrays[rng.choice((name + "s", "\u00e4", "x0"))] = arrays.pop(name)
    else:
        arrays[name] = rng.choice(ARRAYS)(arrays[name])
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _parquet(content: bytes, rng: random.Random) -> bytes:
    table = pyarrow.parquet.read_table(io.BytesIO(content))
    metadata = (table.schema.metadata or {}).get(b"rover_pin")
    if metadata and rng.random() < 0.5:
        return _packed(table.replace_schema_metadata({b"rover_pin": _json(metadata, rng)}))
    at, way = rng.randrange(table.num_columns), rng.randrange(6)
    name, rows = table.column_names[at], table.num_rows
    if way == 0:
        table = table.remove_column(at)
    elif way == 1:
        table = table.rename_columns([*table.column_names[:at], rng.choice(KEYS), *table.column_names[at + 1 :]])
    elif way == 2:
        table = table.append_column(name, table.column(at))
    elif way == 3:
        table = table.slice(0, rng.choice((0, 1)))
    elif way == 4:
        choices = rng.choice((b"", b"{", b"[]", b'{"units": 3}', b'{"units": {"body_x": 3}, "attrs": []}', b"\xff"))
        table = table.replace_schema_metadata({b"rover_pin": choices, b"pandas": b"{"})
    else:
        second = rng.choice(
            (["x"] * rows, [None] * rows, [[1.0]] * rows, [b"\xff"] * rows, [True] * rows, [{"a": 1}] * rows,
             [datetime.date(2026, 1, 1)] * rows, [10**18] * rows, [float("inf")] * rows)
        )  # fmt: skip
        table = table.set_column(at, name, pyarrow.array(second))
    return _packed(table)


def _json(content: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.2:
        return rng.choice((_bytes(content, rng), b"[" * 50_000, b"null", b"3"))
    tree = json.loads(content)
    _change_node(tree, rng)
    return json.dumps(tree, default=str).encode()


def _packed(table: pyarrow.Table) -> bytes:
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(table, buffer)
    return buffer.getvalue()
