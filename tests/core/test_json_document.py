"""JSON is read strictly, and whatever else is there is one clear error."""

from __future__ import annotations

from pathlib import Path

import pytest

from albot_core.errors import InputError
from albot_core.json_document import parse_json, read_json


def test_values_are_read_as_they_stand() -> None:
    assert parse_json('{"a": [1, 2.5, -3e2, true, null, "x"]}', "a") == {
        "a": [1, 2.5, -300.0, True, None, "x"]
    }
    assert parse_json(b"1" + b"0" * 39, "a") == 10**39
    deep = "[" * 100 + "]" * 100
    assert str(parse_json(deep, "a")) == deep


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "a.json, line 1: expected valid JSON"),
        (b'{"a": 1,\n"b"', "a.json, line 2: expected valid JSON"),
        (b"{}{}", "a.json, line 1: expected valid JSON, found Extra data"),
        (b'"\xff"', "a.json, line 1: expected UTF-8 text, found the byte 0xff"),
        (b"NaN", "expected finite numbers of 40 digits at most, found NaN"),
        (b"[-Infinity]", "finite numbers of 40 digits at most, found -Infinity"),
        (b"1e400", "finite numbers of 40 digits at most, found 1e400"),
        (b"9" * 401, "40 digits at most, found one of 401 digits"),
        (b"9" * 5000, "40 digits at most, found one of 5000 digits"),
        (b"[" * 101 + b"]" * 101, "JSON nested 100 levels at most, found more"),
        (b"[" * 100_000, "JSON nested 100 levels at most, found more"),
        (b'{"a":' * 500 + b"1" + b"}" * 500, "JSON nested 100 levels at most, found more"),
    ],
)
def test_what_is_no_such_json_is_refused(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_json(path)
    assert str(caught.value).startswith(str(path))
    with pytest.raises(InputError, match=r"^a, header: expected"):
        parse_json(content, "a", "header")
