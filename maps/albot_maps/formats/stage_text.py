"""The text of a Stage world file: models with properties, nested, and named by `define`.

The syntax is that of https://player-stage-manual.readthedocs.io: `include "file"`,
`define NAME TYPE ( … )`, `TYPE ( … )` and `property value`, where a value is a number, a
quoted text or a row of them in square brackets; `#` begins a comment.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from albot_core.errors import InputError
from albot_core.files import read_bytes

Value = str | float | list[str | float]
"""What a property is set to."""

_TOKEN = re.compile(
    r"""(?P<skip>[ \t\r]+|\#[^\n]*)|(?P<line>\n)|"(?P<text>[^"\n]*)"|(?P<mark>[()\[\]])
    |(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))
    |(?P<word>[A-Za-z_][\w.\-]*(?:\[\d+\])?)""",
    re.VERBOSE,
)
_DEEPEST = 50
"""How deep files may include each other, and models stand in each other."""


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


@dataclass(kw_only=True)
class Model:
    """A model as the file describes it."""

    type: str
    """What it is: a type of Stage's own, or one that was defined."""
    path: Path
    """The file it stands in."""
    line: int
    """Where it begins."""
    values: dict[str, Value] = field(default_factory=dict)
    """Its properties."""
    parts: list[Model] = field(default_factory=list)
    """The models that stand in it."""


@dataclass
class StageText:
    """A Stage world file and the files that it includes."""

    models: list[Model] = field(default_factory=list)
    """What stands in the world."""
    defined: dict[str, Model] = field(default_factory=dict)
    """The types that were defined, by name."""
    missing: list[str] = field(default_factory=list)
    """Included files that are not there."""

    def read(self, path: Path, depth: int = 0) -> None:
        """Add what a file holds.

        Raises:
            InputError: It cannot be read, or breaks the syntax.
        """
        if depth > _DEEPEST:
            raise InputError(path, f"files included {_DEEPEST} deep at most", "more")
        reader = _Reader(path)
        while (token := reader.next()) is not None:
            if token.text == "include" and token.kind == "word":
                name = reader.expect("text", "the name of a file").text
                included = path.parent / name
                if included.is_file():
                    self.read(included, depth + 1)
                else:
                    self.missing.append(name)
            elif token.text == "define" and token.kind == "word":
                name = reader.expect("word", "a name").text
                self.defined[name] = reader.model(reader.expect("word", "a type"))
            elif (model := reader.model_or_value(token, {}, 0)) is not None:
                self.models.append(model)


class _Reader:
    """The tokens of one file, one after another."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            text = read_bytes(path).decode()
        except UnicodeDecodeError as error:
            found = f"the byte 0x{error.object[error.start]:02x}"
            raise InputError(path, "UTF-8 text", found) from None
        self._tokens = list(self._split(text))
        self._position = 0

    def next(self) -> _Token | None:
        """The next token; None at the end."""
        if self._position == len(self._tokens):
            return None
        self._position += 1
        return self._tokens[self._position - 1]

    def expect(self, kind: str, what: str) -> _Token:
        """The next token, which must be of a kind."""
        token = self.next()
        if token is None or token.kind != kind:
            raise self._error(what, token)
        return token

    def model(self, token: _Token, depth: int = 0) -> Model:
        """A model whose type is the token, from its `(` to its `)`."""
        if depth > _DEEPEST:
            raise self._error(f"models nested {_DEEPEST} deep at most", token)
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
        """The model that begins here; or None, after a property was put among the values."""
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
        place = f"line {found.line}" if found else "its end"
        return InputError(self._path, expected, repr(found.text) if found else "", place=place)
