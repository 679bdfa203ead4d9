"""The text of Stage's `.world` files: models, the types that files define, and includes.

The syntax is that of https://player-stage-manual.readthedocs.io: `include "file"`,
`define NAME TYPE ( … )`, `TYPE ( … )` and `property value`. A value is a number, a quoted
text, or a row of these in square brackets; `#` begins a comment.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from albot_core.errors import InputError
from albot_core.files import exists, read_text

Value = str | float | list[str | float]
"""Value of a property."""

_TOKEN = re.compile(
    r"""(?P<skip>[ \t\r]+|\#[^\n]*)|(?P<line>\n)|"(?P<text>[^"\n]*)"|(?P<mark>[()\[\]])
    |(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))
    |(?P<odd>[-+.\d][\w.+\-]*)|(?P<word>[A-Za-z_][\w.\-]*(?:\[\d+\][\w.]*)*)""",
    re.VERBOSE,
)
"""What is `odd` begins like a number. It matters only where a number is needed."""
_DEEPEST_NESTING = 50
"""Largest depth of nested includes, and of nested models."""
_LARGEST = 4 << 20
"""Largest size of a file (bytes); real worlds have a few thousand."""


@dataclass(kw_only=True)
class Model:
    """A model as written in the file."""

    type: str
    """Its type: one of Stage's own, or one that a file defines."""
    path: Path
    """The file that contains it."""
    line: int
    """Line at which it begins."""
    values: dict[str, Value] = field(default_factory=dict)
    """Its properties."""
    parts: list[Model] = field(default_factory=list)
    """The models nested in it."""


@dataclass
class StageText:
    """A Stage world file and the files that it includes."""

    models: list[Model] = field(default_factory=list)
    """The models of the world."""
    defined: dict[str, Model] = field(default_factory=dict)
    """The types that files define, by name."""
    missing: list[str] = field(default_factory=list)
    """Included files that are missing."""

    def read(self, path: Path, depth: int = 0) -> None:
        """Add the content of a file.

        Raises:
            InputError: The file cannot be read, or has a syntax error.
        """
        if depth > _DEEPEST_NESTING:
            raise InputError(path, f"files included {_DEEPEST_NESTING} deep at most", "more")
        parser = _Parser(path)
        while (token := parser.next()) is not None:
            if token.text == "include" and token.kind == "word":
                _, name, line = parser.expect("text", "the name of a file")
                included = path.parent / name
                if not exists(included):
                    self.missing.append(name)
                elif included.is_dir():
                    place = f"line {line}, include"
                    raise InputError(path, "a file, not a folder", repr(name), place=place)
                else:
                    self.read(included, depth + 1)
            elif token.text == "define" and token.kind == "word":
                name = parser.expect("word", "a name").text
                self.defined[name] = parser.model(parser.expect("word", "a type"))
            elif (model := parser.model_or_value(token, {}, 0)) is not None:
                self.models.append(model)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


class _Parser:
    """A parser of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tokens = list(self._split(read_text(path, _LARGEST)))
        self._position = 0

    def next(self) -> _Token | None:
        """Return the next token; None at the end."""
        if self._position == len(self._tokens):
            return None
        self._position += 1
        return self._tokens[self._position - 1]

    def expect(self, kind: str, what: str) -> _Token:
        """Return the next token; raise InputError if it is not of `kind`."""
        token = self.next()
        if token is None or token.kind != kind:
            raise self._error(what, token)
        return token

    def model(self, token: _Token, depth: int = 0) -> Model:
        """Return the model whose type is `token`, parsed from its `(` to its `)`."""
        if depth > _DEEPEST_NESTING:
            raise self._error(f"models nested {_DEEPEST_NESTING} deep at most", token)
        model = Model(type=token.text, path=self._path, line=token.line)
        opened = self.next()
        if opened is None or opened.text != "(":
            raise self._error("(", opened)
        while (inner := self.next()) is None or inner.text != ")" or inner.kind != "mark":
            if inner is None:
                raise self._error(f"a ) for the ( of line {opened.line}", None)
            part = self.model_or_value(inner, model.values, depth)
            if part is not None:
                model.parts.append(part)
        return model

    def model_or_value(self, token: _Token, values: dict[str, Value], depth: int) -> Model | None:
        """Return the model that begins with `token`; None after storing a property in `values`."""
        if token.kind != "word":
            raise self._error("a model or a property", token)
        following = self.next()
        if following is not None and following.kind == "mark" and following.text == "(":
            self._position -= 1
            return self.model(token, depth + 1)
        values[token.text] = self._value(following)
        return None

    def _value(self, token: _Token | None) -> Value:
        if token is None or (token.kind == "mark" and token.text != "["):
            raise self._error("a value", token)
        if token.kind != "mark":
            return float(token.text) if token.kind == "number" else token.text
        row: list[str | float] = []
        while (item := self.next()) is not None and item.kind != "mark":
            row.append(float(item.text) if item.kind == "number" else item.text)
        if item is None or item.text != "]":
            raise self._error("]", item)
        return row

    def _split(self, text: str) -> Iterator[_Token]:
        position, line = 0, 1
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                raise self._error("Stage's syntax", _Token("", text[position], line))
            kind = str(match.lastgroup)
            if kind == "line":
                line += 1
            elif kind != "skip":
                yield _Token(kind, match[kind], line)
            position = match.end()

    def _error(self, expected: str, found: _Token | None) -> InputError:
        place = f"line {found.line}" if found else "end of the file"
        return InputError(self._path, expected, repr(found.text) if found else "", place=place)
