"""One-line faults in the project's own source, drawn by a seed.

The kinds are the operators of mutation testing that change one place of one line (Offutt and
others, *An experimental determination of sufficient mutant operators*, 1996; Delamaro, Offutt and
Ammann, *Designing deletion mutation operators*, 2014).
"""

from __future__ import annotations

import ast
import hashlib
import math
import random
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TypeGuard

ROOT = Path(__file__).parents[2]
FOLDERS = ("core", "maps", ".", "agents", "scripts")
"""The folders that contain the packages below."""
PACKAGES = (
    "core/albot_core",
    "maps/albot_maps",
    "albot_env",
    "agents/albot_agents",
    "scripts/albot_cli",
)
"""The packages whose modules get faults. Experiments and benchmarks are programs that measure."""

_RELATIONS = {
    ast.Lt: ("<", ">="), ast.LtE: ("<=", ">"), ast.Gt: (">", "<="), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"),
}  # fmt: skip
_ARITHMETIC = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"), ast.Mod: ("%", "*"), ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"),
}  # fmt: skip
_BORDERS = {ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">")}
"""Used where a length is compared. Two numbers with fractions are hardly ever equal."""
_PAIRS = (
    ("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("floor", "ceil"),
    ("sin", "cos"), ("any", "all"), ("zeros", "ones"), ("amin", "amax"), ("nanmin", "nanmax"),
)  # fmt: skip
_OTHER = {one: other for pair in _PAIRS for one, other in (pair, pair[::-1])}
_SYMMETRIC = {"hypot", "isinstance", "allclose", "array_equal", "dict", "print", *_OTHER}
"""Functions whose arguments may be exchanged, or are never given in another order."""

# Code whose faults do not affect the project's results, by rule:
_APPEARANCE = ("rendering/", "export/picture", "albot_maps/drawing", "evaluation/picture")
"""Modules in which constants are colours, sizes and positions on a picture."""
_TIDYING = {
    "close", "kill", "wait", "flush", "collect", "join", "setLevel", "warning", "debug", "info",
}  # fmt: skip
"""Statements that release or report something: no result depends on them."""
_GUARDS = {"strict", "encoding", "help", "show_default", "metavar", "dtype", "copy", "fmt"}
"""Arguments that guard against another's fault, are the default, or are texts for people."""
_TINY, _HUGE = 1e-6, 1e6
"""Numbers beyond these are tolerances, and bounds that nothing reaches."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault in one place of one line."""

    path: str
    """The module's path, relative to the project's folder."""
    line: int
    """Number of the line, from 1."""
    kind: str
    """The operator of mutation testing."""
    old: str
    """The original line."""
    new: str
    """The line with the fault."""


@dataclass(frozen=True)
class _Change:
    """A part of a line, in bytes, and its replacement."""

    kind: str
    line: int
    start: int
    end: int
    text: str


def modules() -> list[str]:
    """Return the paths of all modules that may get faults."""
    found = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return sorted(str(path.relative_to(ROOT)) for path in found if path.name != "__init__.py")


def draw_faults(seed: int, share: float) -> list[Fault]:
    """Return one fault for each of this share of the modules of every folder, rounded up.

    The choice of modules, and of a module's fault, depends on the seed, the module's path and its
    own text; so the faults of other modules stay the same when one module changes. The kind is
    drawn first, then one of the places where the module can have it.
    """
    folders = defaultdict(list)
    for path in modules():
        folders[Path(path).parent].append(path)
    faults: list[Fault] = []
    for paths in folders.values():
        paths.sort(key=lambda path: _digest(seed, path))
        found = (fault for path in paths if (fault := _draw_fault(seed, path)) is not None)
        faults += islice(found, math.ceil(share * len(paths)))
    return sorted(faults, key=lambda fault: (fault.path, fault.line))


def all_faults(path: str) -> list[Fault]:
    """Return every fault that a module can have."""
    text = (ROOT / path).read_bytes()
    lines = text.splitlines()
    faults = []
    for change in _Changes(path, lines).of(ast.parse(text)):
        line = lines[change.line - 1]
        new = line[: change.start] + change.text.encode() + line[change.end :]
        faults.append(
            Fault(
                path=path, line=change.line, kind=change.kind, old=line.decode(), new=new.decode()
            )
        )
    return faults


def _draw_fault(seed: int, path: str) -> Fault | None:
    kinds = defaultdict(list)
    for fault in all_faults(path):
        kinds[fault.kind].append(fault)
    if not kinds:
        return None
    draw = random.Random(_digest(seed, path))
    return draw.choice(kinds[draw.choice(sorted(kinds))])


def _digest(seed: int, path: str) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed} {path}".encode()).digest())


class _Changes:
    """All changes of one module's lines."""

    def __init__(self, path: str, lines: list[bytes]) -> None:
        self._lines = lines
        self._has_figures = not any(part in path for part in _APPEARANCE)

    def of(self, node: ast.AST) -> Iterator[_Change]:
        """Yield the changes within a node."""
        if getattr(node, "lineno", 0) == getattr(node, "end_lineno", 0) != 0:
            yield from self._changes(node)
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "type_params", "keywords"):
                continue
            for child in value if isinstance(value, list) else (value,):
                if isinstance(child, ast.AST) and not _is_left_alone(child):
                    yield from self.of(child)
        for keyword in getattr(node, "keywords", ()):
            if keyword.arg not in _GUARDS:
                yield from self.of(keyword.value)

    def _changes(self, node: ast.AST) -> Iterator[_Change]:
        yield from self._changes_of_operator(node)
        yield from self._changes_of_value(node)
        match node:
            case ast.Call():
                yield from self._changes_of_call(node)
            case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
                if isinstance(test, ast.Name | ast.Attribute | ast.Call):
                    yield self._instead("negation", test, f"(not {self._text(test)})")
            case (
                ast.AugAssign()
                | ast.Assign(targets=[ast.Attribute() | ast.Subscript()])
                | ast.Expr(value=ast.Call())
            ):
                yield self._instead("statement deletion", node, "pass")

    def _changes_of_operator(self, node: ast.AST) -> Iterator[_Change]:
        match node:
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                yield from self._operator("relational operator", _RELATIONS, left, op, right)
                if _is_length(left) or _is_length(right):
                    yield from self._operator("relational operator", _BORDERS, left, op, right)
            case ast.BoolOp(op=op, values=[left, right, *_]):
                words = {ast.And: ("and", "or"), ast.Or: ("or", "and")}
                yield from self._operator("logical connector", words, left, op, right)
            case ast.BinOp(left=left, op=op, right=right):
                if not (_is_text(left) or _is_text(right)):
                    yield from self._operator("arithmetic operator", _ARITHMETIC, left, op, right)
                    yield self._instead("operand deletion", node, f"({self._text(left)})")
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                yield self._instead("sign deletion", node, f"({self._text(operand)})")
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                yield self._instead("negation", node, f"bool({self._text(operand)})")

    def _changes_of_value(self, node: ast.AST) -> Iterator[_Change]:
        match node:
            case ast.Constant(value=value) if self._has_figures and _is_number(value):
                other = repr(2 * value or 1.0) if isinstance(value, float) else str(value + 1)
                yield self._instead("constant", node, other)
            case ast.Name(id=name) if name in _OTHER:
                yield self._instead("function", node, _OTHER[name])
            case ast.Attribute(attr=name) if name in _OTHER:
                end = _end(node)
                yield _Change("function", node.lineno, end - len(name), end, _OTHER[name])

    def _changes_of_call(self, node: ast.Call) -> Iterator[_Change]:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name == "abs" and len(node.args) == 1:
            yield self._instead("function", node, f"({self._text(node.args[0])})")
        for one, other in zip(node.args, node.args[1:], strict=False):
            texts = self._text(one), self._text(other)
            starred = isinstance(one, ast.Starred) or isinstance(other, ast.Starred)
            if name not in _SYMMETRIC and not starred and texts[0] != texts[1]:
                between = self._lines[node.lineno - 1][one.end_col_offset : other.col_offset]
                text = f"{texts[1]}{between.decode()}{texts[0]}"
                yield _Change("argument swap", node.lineno, one.col_offset, _end(other), text)
        for keyword in node.keywords:
            line = self._lines[keyword.lineno - 1]
            before = line[: keyword.col_offset].rstrip()
            if keyword.arg is None or keyword.arg in _GUARDS or not before.endswith((b",", b"(")):
                continue
            start, end = len(before), _end(keyword)
            if before.endswith(b","):
                start -= 1
            elif line[end : end + 2] == b", ":
                end += 2
            yield _Change("argument deletion", keyword.lineno, start, end, "")

    def _operator(
        self,
        kind: str,
        table: Mapping[Any, tuple[str, str]],
        left: ast.expr,
        op: ast.AST,
        right: ast.expr,
    ) -> Iterator[_Change]:
        if type(op) not in table:
            return
        old, new = table[type(op)]
        assert left.end_lineno is not None  # `ast.parse` gives all positions.
        after = _end(left)
        between = self._lines[left.end_lineno - 1][after : right.col_offset]
        start = after + between.find(old.encode())
        yield _Change(kind, left.end_lineno, start, start + len(old), new)

    def _instead(self, kind: str, node: ast.expr | ast.stmt, text: str) -> _Change:
        return _Change(kind, node.lineno, node.col_offset, _end(node), text)

    def _text(self, node: ast.expr) -> str:
        return self._lines[node.lineno - 1][node.col_offset : _end(node)].decode()


def _end(node: ast.expr | ast.stmt | ast.keyword) -> int:
    assert node.end_col_offset is not None
    return node.end_col_offset


def _is_left_alone(node: ast.AST) -> bool:
    """Return whether the code below a node does not affect the project's results.

    These are errors and checks of our own faults, texts, imports, types, and tidying.
    """
    match node:
        case ast.Raise() | ast.Assert() | ast.JoinedStr() | ast.Import() | ast.ImportFrom():
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.FunctionDef(name="__repr__" | "__str__"):
            return True
        case ast.Call(func=ast.Name(id="InputError" | "warn" | "cast")):
            return True
        case ast.Expr(value=ast.Call(func=ast.Attribute(attr=name))):
            return name in _TIDYING
        case ast.Expr(value=ast.Constant()):
            return True
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name.startswith("__") or re.fullmatch("_?[A-Z][A-Za-z]*[a-z]", name) is not None
    return False


def _is_length(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and getattr(node.func, "id", "") == "len"


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _is_number(value: object) -> TypeGuard[int | float]:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return value == 0 or _TINY < abs(value) < _HUGE
