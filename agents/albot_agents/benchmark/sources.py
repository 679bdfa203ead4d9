"""A digest of the sources of an agent and its mapper.

The version of albot-env does not tell one state of a development from another. The digest does, for
what differs between the rows of the table: the mapper, and a scripted agent with what plans for it
or a trained one with what computes its network (its weights have a fingerprint of their own).
What all rows share, such as the simulator and the tasks, is not in it.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_DIGITS = 16
"""Length of a digest: hexadecimal digits of a SHA-256 hash."""
_ROOMS = (
    "albot_agents.scripted.",
    "albot_agents.trained.",
    "albot_core.matching.",
    "albot_core.planning.",
)
"""Packages whose modules count, besides those of mappers."""
_MAPPERS = "albot_core.mappers."
"""The package of mappers; modules of packages in it count, not those that all mappers share."""


def source_digest(modules: Iterable[str], others: Iterable[str] = ()) -> str:
    """Return a digest of modules and all those that count which they import, at any depth.

    Comments, docstrings and layout are left out of it, so that they may be edited between runs.

    Args:
        modules: Names of modules. Those of other distributions count with their packages.
        others: Texts that decide on the results, too, such as fingerprints of trained agents.
    """
    starts = list(modules)
    rooms = (*_ROOMS, *(f"{name.partition('.')[0]}." for name in starts if not _is_ours(name)))
    left, found = list(starts), dict[str, str]()
    while left:
        name = left.pop()
        counts = name in starts or name.startswith(rooms) or _is_of_a_mapper(name)
        if name not in found and counts and (module := _module(name)) is not None:
            found[name], imported = module
            left += imported
    parts = [*others, *(f"{name} {digest}" for name, digest in sorted(found.items()))]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:_DIGITS]


def _is_ours(module: str) -> bool:
    return module.startswith("albot_")


def _is_of_a_mapper(module: str) -> bool:
    return module.startswith(_MAPPERS) and "." in module.removeprefix(_MAPPERS)


@cache
def _module(name: str) -> tuple[str, tuple[str, ...]] | None:
    """Return the digest of a module and what it imports; None if it has no source."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):  # A name in a module; or `__main__`.
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    tree = ast.parse(Path(spec.origin).read_bytes())
    text = repr(_meaning(tree))
    return hashlib.sha256(text.encode()).hexdigest(), tuple(_imported(tree))


def _imported(tree: ast.Module) -> Iterable[str]:
    """Yield names of imported modules; some may be names in modules."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _meaning(node: Any) -> Any:
    """Return a syntax tree as nested tuples, without docstrings.

    Empty fields are left out, because newer versions of Python add such.
    """
    if isinstance(node, list):
        return tuple(_meaning(each) for each in node if not _is_docstring(each))
    if not isinstance(node, ast.AST):
        return node
    fields = ((name, value) for name, value in ast.iter_fields(node) if value not in (None, []))
    return (type(node).__name__, *((name, _meaning(value)) for name, value in fields))


def _is_docstring(node: Any) -> bool:
    """Return whether a statement is a text alone: a docstring of anything."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
