"""Scalars of YAML: integers are whole, and what no array can hold is told where it stands."""

from __future__ import annotations

import pytest

from albot_core.errors import InputError
from albot_core.yaml_document import YamlDocument


@pytest.mark.parametrize("number", [0, -7, 10**18, 2**63 - 1, 1 - 2**63])
def test_an_integer_is_read_exactly(number: int) -> None:
    found = YamlDocument(f"seed: {number}", "a.yml").data["seed"]
    assert (type(found), found) == (int, number)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (str(2**63), str(2**63)),
        (str(-(2**63)), str(-(2**63))),
        ("9" * 5000, "one of 5000 digits"),
    ],
)
def test_a_larger_integer_is_told_with_its_digits(text: str, found: str) -> None:
    with pytest.raises(InputError) as caught:
        YamlDocument(f"a: 1\nb: {{seed: [0, {text}]}}", "a.yml")
    expected = "expected an integer within ±9223372036854775807"
    assert str(caught.value) == f"a.yml, line 2, b.seed[1]: {expected}, found {found}"


def test_large_numbers_that_are_not_integers_are_numbers() -> None:
    assert YamlDocument("[1e30, 92233720368547758080.0]", "a.yml").data == [1e30, 2.0**63 * 10]
