"""All changes of a Python file, one at a time: operators, terms, constants, comparisons, branches, names."""

from __future__ import annotations

import ast
import functools
from typing import NamedTuple

Sign = tuple[str, tuple[str, ...]]
SIGNS: dict[type, Sign] = {
    ast.Add: ("+", ("-",)), ast.Sub: ("-", ("+",)), ast.Mult: ("*", ("/",)), ast.Div: ("/", ("*",)),
    ast.Pow: ("**", ("*",)), ast.And: ("and", ("or",)), ast.Or: ("or", ("and",)), ast.Lt: ("<", (">=", "<=")),
    ast.LtE: ("<=", (">", "<")), ast.Gt: (">", ("<=", ">=")), ast.GtE: (">=", ("<", ">")), ast.Eq: ("==", ("!=", ">=")),
    ast.NotEq: ("!=", ("==",)), ast.Is: ("is", ("is not",)), ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)), ast.NotIn: ("not in", ("in",)),
}  # fmt: skip
NAMES = {"fmin": "fmax", "min": "max", "sin": "cos", "minimum": "maximum", "all": "any"}
NAMES |= {other: name for name, other in NAMES.items()}
DECLARED = {"quantity", "TypeVar", "lru_cache", "Function", "sym"}
"""Calls whose arguments are declarations, not laws."""
FLOOR = 1e-6
"""Numbers up to here guard against a division by 0 or a root of less; a tenth more of them is nothing."""
COUNTS = {"len", "sum", "range", "count", "round", "int", "ndim", "size"}
"""What counts: elsewhere two numbers are never equal, and `<` is as good as `<=`."""
TOUCH = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}


class Mutant(NamedTuple):
    """One change of a text: from `start` to `end` stands `new` instead."""

    line: int
    start: int
    end: int
    new: str
    said: str

    def of(self, text: str) -> str:
        """Return the changed text."""
        return text[: self.start] + self.new + text[self.end :]


def counts(node: ast.expr) -> bool:
    """Return whether an expression is a whole number: a literal, or one that is counted."""
    if isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        return name in COUNTS
    if isinstance(node, ast.Attribute):
        return node.attr in COUNTS
    if isinstance(node, ast.BinOp):
        return counts(node.left) or counts(node.right)
    return isinstance(node, ast.Constant) and type(node.value) is int


class Changes(ast.NodeVisitor):
    """Collects the changes of a text in which one character is one byte."""

    def __init__(self, text: str):
        self.text, self.lines, self.found = text, text.splitlines(keepends=True), list[Mutant]()
        lengths = [len(line) for line in self.lines]
        self.starts = [sum(lengths[:at]) for at in range(len(lengths) + 1)]
        self.visit(ast.parse(text.encode("latin-1")))

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Return where an expression stands."""
        last = (node.end_lineno or node.lineno) - 1
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[last] + (node.end_col_offset or 0)

    def old(self, node: ast.expr) -> str:
        """Return the text of an expression."""
        return self.text[slice(*self.span(node))]

    def add(self, span: tuple[int, int], new: str) -> None:
        """Keep a change of a stretch of the text, told with the line on which it begins."""
        line = self.text.count("\n", 0, span[0])
        told = f"{self.lines[line].strip()}: {' '.join(self.text[slice(*span)].split())} -> {new}"
        self.found.append(Mutant(line + 1, *span, new, told))

    def signs(self, left: ast.expr, op: ast.AST, right: ast.expr) -> None:
        """Keep the changes of the sign between two expressions."""
        sign, others = SIGNS[type(op)]
        begin, end = self.span(left)[1], self.span(right)[0]
        at = begin + self.text[begin:end].index(sign)
        for other in others:
            if TOUCH.get(sign) != other or counts(left) or counts(right):
                self.add((at, at + len(sign)), other)

    def visit_BinOp(self, node: ast.BinOp) -> None:  # noqa: D102
        sides = (node.left, node.right)
        texts = [isinstance(each, ast.JoinedStr) or isinstance(getattr(each, "value", 0), str) for each in sides]
        if type(node.op) in SIGNS and not any(texts):
            self.signs(node.left, node.op, node.right)
            self.add(self.span(node), f"({self.old(node.left)})")
            if isinstance(node.op, ast.Add):
                self.add(self.span(node), f"({self.old(node.right)})")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:  # noqa: D102
        for left, op, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            self.signs(left, op, right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:  # noqa: D102
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.signs(left, node.op, right)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:  # noqa: D102
        if isinstance(node.value, bool):
            self.add(self.span(node), str(not node.value))
        elif isinstance(node.value, int):
            self.add(self.span(node), str(node.value + 1))
        elif isinstance(node.value, float) and (node.value == 0.0 or abs(node.value) > FLOOR):
            self.add(self.span(node), repr(1.1 * node.value or 0.1))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:  # noqa: D102
        if isinstance(node.op, (ast.USub, ast.Not)):
            self.add(self.span(node), f"({self.old(node.operand)})")
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:  # noqa: D102
        self.add(self.span(node.body), f"({self.old(node.orelse)})")
        self.add(self.span(node.orelse), f"({self.old(node.body)})")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:  # noqa: D102
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in NAMES:
            end = self.span(node.func)[1]
            self.add((end - len(name), end), NAMES[name])
        if name not in DECLARED:
            self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:  # noqa: D102
        if node.arg not in ("strict", "repr"):
            self.visit(node.value)

    def visit_Subscript(self, node: ast.Subscript) -> None:  # noqa: D102
        self.visit(node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:  # noqa: D102
        if node.value is not None:
            self.visit(node.value)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:  # noqa: D102
        for each in node.body:
            self.visit(each)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:  # noqa: D102
        for each in (*node.args.defaults, *node.body):
            self.visit(each)

    def visit_Raise(self, node: ast.Raise) -> None:
        """A message is no law."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Nor are words."""


def changes(text: str) -> list[Mutant]:
    """Return all changes of a Python text."""
    return Changes(text).found


@functools.lru_cache(maxsize=4)
def _nodes(text: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(text.encode("latin-1"))))


def lines_of(text: str, mutant: Mutant) -> set[int] | None:
    """Return the lines whose execution runs the changed expression; None where it runs while modules are imported."""
    function, statement = None, None
    for node in _nodes(text):
        if isinstance(node, ast.stmt) and node.lineno <= mutant.line <= (node.end_lineno or node.lineno):
            statement = node if statement is None or node.lineno >= statement.lineno else statement
            inner = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and mutant.line >= node.body[0].lineno
            function = node if inner else function
    if function is None or statement is None:
        return None
    body = getattr(statement, "body", None)
    last = body[0].lineno - 1 if body else statement.end_lineno or statement.lineno
    return set(range(statement.lineno, max(last, statement.lineno) + 1))
