"""Strict reading of YAML, with the line of every value."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import yaml

from albot_core.errors import InputError
from albot_core.files import read_text

LARGEST = 4 << 20
"""Largest size of a YAML file (bytes); a large building traced from a grid has two million."""

_LARGEST_WHOLE = 2**63 - 1
"""Largest absolute integer, so that every array can hold it."""
_WIDTH = 80
"""Column after which long lists are broken."""
_DIGITS = 40
"""Longest integer that an error shows in full."""

KeyPath = tuple[str | int, ...]
"""The path to a value from the top of a document: keys and indices."""


_COLLECTIONS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")


class _Loader(yaml.BaseLoader):
    """PyYAML with the scalars of YAML 1.2: `1e-3` is a number, `no` and `1:30` are text."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Raise for aliases, a few lines of which can expand to an endless document."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(
                problem="an alias, which is not supported", problem_mark=self.get_mark()
            )
        return super().compose_node(parent, index)


class _Dumper(yaml.SafeDumper):
    """PyYAML without aliases, which quotes text that `_Loader` would take for something else."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


for _tag, _pattern in {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN",
}.items():
    for _kind in (_Loader, _Dumper):
        _kind.add_implicit_resolver(
            f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), None
        )


class YamlDocument:
    """Plain data from YAML text, with the line on which each value begins.

    Args:
        text: The text.
        source: Origin of the text, for errors.

    Raises:
        InputError: The text is not YAML, holds a duplicate key, a key that is not text, an alias
            or a tag, or is nested too deeply.
    """

    def __init__(self, text: str, source: object) -> None:
        self._source = source
        self._lines: dict[KeyPath, int] = {}
        try:
            root = yaml.compose(text, Loader=_Loader)
            self.data: Any = None if root is None else self._plain(root, (), _line(root))
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, int(error.position)) + 1
            found = f"the character {chr(error.character)!r}"
            raise self._error(line, "text that YAML allows", found) from None
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            line = mark.line + 1 if mark else 1
            raise self._error(line, f"valid YAML ({error.problem})", "") from None
        except RecursionError:
            raise InputError(source, "a document without deep nesting", "too many levels") from None

    def place(self, path: Sequence[str | int]) -> str:
        """Return the text for a path in errors: `line 7, walls[3]`."""
        known = tuple(path)
        while known and known not in self._lines:
            known = known[:-1]
        name = dotted(path)
        line = self._lines.get(known)
        return ", ".join(part for part in (f"line {line}" if line else "", name) if part)

    def _plain(self, node: yaml.Node, path: KeyPath, line: int) -> Any:
        if path in self._lines:
            raise self._error(line, f"the key {path[-1]!r} once", "a duplicate")
        self._lines[path] = line
        if isinstance(node, yaml.CollectionNode) and node.tag not in _COLLECTIONS:
            raise self._error(line, "plain values", f"the tag {node.tag}")
        if isinstance(node, yaml.MappingNode):
            return {
                key: self._plain(value, (*path, key), line)
                for key, value, line in map(self._entry, node.value)
            }
        if isinstance(node, yaml.SequenceNode):
            return [
                self._plain(item, (*path, index), _line(item))
                for index, item in enumerate(node.value)
            ]
        return self._scalar(node, path)

    def _entry(self, pair: tuple[yaml.Node, yaml.Node]) -> tuple[str, yaml.Node, int]:
        """Return an entry's key, its value, and the key's line."""
        key, value = pair
        if not isinstance(key, yaml.ScalarNode):
            raise self._error(_line(key), "a key that is text", "a collection")
        return str(key.value), value, _line(key)

    def _scalar(self, node: yaml.Node, path: KeyPath) -> Any:
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        text = node.value
        match kind:
            case "str":
                return text
            case "null":
                return None
            case "bool":
                return text.lower() == "true"
            case "int":
                return self._whole(text, path)
            case "float":
                return float(re.sub(r"(?i)\.(inf|nan)$", r"\1", text))
        raise self._error(self._lines[path], "plain values", f"the tag {node.tag}")

    def _whole(self, text: str, path: KeyPath) -> int:
        """Return an integer; raise InputError for one that does not fit into 64 bits."""
        short = len(text) <= _DIGITS
        if short and abs(number := int(text)) <= _LARGEST_WHOLE:
            return number
        found = text if short else f"one of {len(text)} digits"
        expected = f"an integer within ±{_LARGEST_WHOLE}"
        raise InputError(self._source, expected, found, place=self.place(path))

    def _error(self, line: int, expected: str, found: str) -> InputError:
        return InputError(self._source, expected, found, place=f"line {line}")


def _line(node: yaml.Node) -> int:
    return node.start_mark.line + 1


def read_yaml(path: Path) -> YamlDocument:
    """Read the document in a file.

    Raises:
        InputError: The file cannot be read, is larger than `LARGEST`, or is not UTF-8 or YAML.
    """
    return YamlDocument(read_text(path, LARGEST), path)


def dump_yaml(data: Mapping[str, Any]) -> str:
    """Return plain data as YAML, which `YamlDocument` reads back; inner lists are on one line."""
    stream = StringIO()
    dumper = _Dumper(
        stream, default_flow_style=None, sort_keys=False, allow_unicode=True, width=_WIDTH
    )
    node: Any = dumper.represent_data(data)
    node.flow_style = False  # Only what is inside is on one line.
    dumper.open()
    dumper.serialize(node)
    dumper.close()
    return stream.getvalue()


def dotted(path: Sequence[str | int]) -> str:
    """Return a path as text: `exits[2].rooms`."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)[
        1 if path and isinstance(path[0], str) else 0 :
    ]


def format_value(value: Any) -> str:
    """Return a value as text for errors: on one line, and shortened if it is long."""
    try:
        dumped = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10**9)
    except (yaml.YAMLError, ValueError, RecursionError):
        return f"a {type(value).__name__} that cannot be printed"
    text = " ".join(str(dumped).split()).removesuffix(" ...")
    return text if len(text) <= 60 else f"{text[:57]}..."
