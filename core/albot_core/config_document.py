"""Configurations as YAML with comments, which users change and give back.

The comments are the docstrings of the fields and the ranges that the configurations check, so that
they cannot differ from what is read.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from albot_core.plain_data import name_type, to_plain
from albot_core.ranges import checked_ranges
from albot_core.yaml_document import dump_yaml

_WIDTH = 100
"""Largest width of a line with a comment."""
_SAME_LINE = re.compile(r"\n+(?!- )")
"""The end of a line of a docstring, unless an item of a list follows."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A field of a configuration, or of a configuration inside it."""

    path: tuple[str, ...]
    """The names of the fields from the outermost configuration to this one."""
    value: Any
    """Its value."""
    meaning: str
    """Its docstring, with the unit; each item of a list on a line of its own."""
    allowed: str
    """The values that it can have, in words; empty for a configuration."""


def parameters(config: Any, path: tuple[str, ...] = ()) -> Iterator[Parameter]:
    """Yield the fields of a configuration in order, each before those inside its value.

    Args:
        config: The configuration, a dataclass.
        path: The path to it, with which those of its fields begin.
    """
    kind: Any = type(config)
    hints, ranges = typing.get_type_hints(kind), checked_ranges(config)
    meanings = field_docs(kind)
    for each in dataclasses.fields(config):
        if not each.init:
            continue
        value, at, allowed = getattr(config, each.name), (*path, each.name), ""
        if not dataclasses.is_dataclass(value):
            allowed = name_type(hints[each.name])
            if each.name in ranges:
                allowed = ranges[each.name].expected
            if type(None) in typing.get_args(hints[each.name]):
                allowed += ", or null"
        meaning = meanings.get(each.name, "")
        yield Parameter(path=at, value=value, meaning=meaning, allowed=allowed)
        if dataclasses.is_dataclass(value):
            yield from parameters(value, at)


def to_yaml(config: Any, heading: str) -> str:
    """Return a configuration as YAML, from which `read_config` makes an equal one.

    Above each field stands its meaning; behind it, or above it if the line is full, the values that
    it can have.

    Args:
        config: The configuration, a dataclass.
        heading: Text of the comment at the top.
    """
    lines = _comment(heading, "")
    for parameter in parameters(config):
        indent, name, value = "  " * (len(parameter.path) - 1), parameter.path[-1], parameter.value
        entry = f"{name}:"
        if not dataclasses.is_dataclass(value):
            entry = dump_yaml({name: to_plain(value)}).rstrip()
        about, behind = parameter.meaning, f"  # {parameter.allowed}" if parameter.allowed else ""
        if behind and ("\n" in entry or len(indent + entry + behind) > _WIDTH):
            about, behind = f"{about} ({parameter.allowed})".strip(), ""
        lines += ["", *_comment(about, indent), textwrap.indent(entry + behind, indent)]
    return "\n".join(lines).strip() + "\n"


def _comment(text: str, indent: str) -> list[str]:
    begin = f"{indent}# "
    return [
        line
        for part in text.splitlines()
        for line in textwrap.wrap(
            part, _WIDTH, initial_indent=begin, subsequent_indent=begin, break_long_words=False
        )
    ]


@cache
def field_docs(kind: type) -> dict[str, str]:
    """Return the docstrings of the fields of a dataclass and its bases, without line breaks."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            found |= _own_field_docs(base)
    return found


def _own_field_docs(kind: type) -> dict[str, str]:
    try:
        source = inspect.getsource(kind)
    except OSError:  # A class that no file holds.
        return {}
    (tree,) = ast.parse(textwrap.dedent(source)).body
    assert isinstance(tree, ast.ClassDef)
    return {
        field.target.id: _SAME_LINE.sub(" ", inspect.cleandoc(doc.value.value))
        for field, doc in pairwise(tree.body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(doc, ast.Expr)
        and isinstance(doc.value, ast.Constant)
        and isinstance(doc.value.value, str)
    }
