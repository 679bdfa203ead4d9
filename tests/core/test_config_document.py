"""Configurations as YAML with comments: what is printed is read back, and says what it means."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, make_dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.config_document import field_docs, parameters, to_yaml
from albot_core.errors import InputError
from albot_core.plain_data import Location, read_config
from albot_core.ranges import POSITIVE, SHARE, check_fields
from albot_core.yaml_document import YamlDocument


@dataclass(frozen=True, kw_only=True)
class Inner:
    """What is inside."""

    share: float = 0.5
    """A share, one of
    - much,
    - little."""

    def __post_init__(self) -> None:
        check_fields(self, SHARE, "share")


@dataclass(frozen=True, kw_only=True)
class Base:
    """What others build on."""

    length: float = 1.0
    """A length (m), explained
    on two lines."""
    undocumented: int = 3

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "length")


@dataclass(frozen=True, kw_only=True)
class Outer(Base):
    """A bit of everything."""

    text: str = "plain"
    """A text."""
    inner: Inner | None = field(default_factory=Inner)
    """Another configuration."""
    sides: tuple[float, ...] = (1.0, 2.0)
    """A list."""
    pairs: tuple[tuple[float, float], ...] = ()
    """A list of lists."""
    limit: float | None = None
    """A limit; None for none."""
    flag: bool = False
    """Whether."""


def _read(text: str) -> Outer:
    document = YamlDocument(text, "file.yml")
    return read_config(Outer, document.data, Location("file.yml", place=document.place))


_NUMBERS = st.floats(allow_nan=False)
_TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]))
_OUTERS = st.builds(
    Outer,
    length=st.floats(1e-300, 1e300),
    undocumented=st.integers(-(2**62), 2**62),
    text=_TEXTS,
    inner=st.none() | st.builds(Inner, share=st.floats(0, 1)),
    sides=st.lists(_NUMBERS, max_size=30).map(tuple),
    pairs=st.lists(st.tuples(_NUMBERS, _NUMBERS), max_size=3).map(tuple),
    limit=st.none() | _NUMBERS,
    flag=st.booleans(),
)


@given(_OUTERS)
def test_what_is_printed_is_read_back(config: Outer) -> None:
    assert _read(to_yaml(config, "A heading.")) == config


@pytest.mark.parametrize(
    "text", ["1e-3", "no", "1:30", "null", "~", "", "900..963", "# x", "a: b", ".inf", "07", "tRue"]
)
def test_text_that_looks_like_something_else_stays_text(text: str) -> None:
    assert _read(to_yaml(Outer(text=text), "")).text == text


def test_the_comments_are_docstrings_and_the_ranges_that_are_checked() -> None:
    assert to_yaml(Outer(), "All of\nit.").splitlines() == [
        "# All of",
        "# it.",
        "",
        "# A length (m), explained on two lines.",
        "length: 1.0  # a positive number",
        "",
        "undocumented: 3  # a whole number",
        "",
        "# A text.",
        "text: plain  # text",
        "",
        "# Another configuration.",
        "inner:",
        "",
        "  # A share, one of",
        "  # - much,",
        "  # - little.",
        "  share: 0.5  # a number within [0, 1]",
        "",
        "# A list.",
        "sides: [1.0, 2.0]  # a list",
        "",
        "# A list of lists.",
        "pairs: []  # a list",
        "",
        "# A limit; None for none.",
        "limit: null  # a number, or null",
        "",
        "# Whether.",
        "flag: false  # true or false",
    ]


def test_a_range_that_does_not_fit_on_the_line_goes_above_it() -> None:
    lines = to_yaml(Outer(text="x" * 95, pairs=((1.0, 2.0), (3.0, math.inf))), "").splitlines()
    assert lines[lines.index("# A text. (text)") + 1] == f"text: {'x' * 95}"
    above = lines.index("# A list of lists. (a list)")
    assert lines[above + 1 : above + 4] == ["pairs:", "- [1.0, 2.0]", "- [3.0, .inf]"]


def test_parameters_come_with_their_paths() -> None:
    found = {parameter.path: parameter for parameter in parameters(Outer())}
    assert list(found)[:4] == [("length",), ("undocumented",), ("text",), ("inner",)]
    assert (found["inner", "share"].value, found["inner",].allowed) == (0.5, "")


def test_a_class_that_no_file_holds_has_no_docstrings() -> None:
    assert field_docs(make_dataclass("Made", [("x", int, 1)])) == {}


@pytest.mark.parametrize(
    ("was", "becomes", "told"),
    [
        ("share: 0.5", "share: 2", ("line 18, inner.share", "a number within [0, 1]", "2")),
        ("length:", "lenght:", ("line 5, lenght", "did you mean length?")),
        ("flag: false", "flag: 0", ("line 30, flag", "true or false", "0")),
    ],
)
def test_a_wrong_key_or_value_is_told_where_it_stands(
    was: str, becomes: str, told: tuple[str, ...]
) -> None:
    text = to_yaml(Outer(), "All of\nit.").replace(was, becomes)
    with pytest.raises(InputError) as error:
        _read(text)
    for words in ("file.yml", *told):
        assert words in str(error.value)
