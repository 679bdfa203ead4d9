"""Parameters of the generators: dataclass fields with a range that is checked on creation."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

from albot_core.errors import InputError

Number = int | float
"""A limit of a range."""


@dataclass(frozen=True, kw_only=True)
class ParameterRange:
    """Type and range of one parameter."""

    type: type[bool] | type[int] | type[float]
    """Type of the value."""
    minimum: Number = 0
    """The smallest value."""
    maximum: Number = 1
    """The largest value."""
    unit: str = ""
    """Unit of a length; empty for a value without a unit."""
    zero: bool = False
    """Whether 0 is allowed too, below the smallest value."""
    usual: int | None = None
    """The value that the generator chooses by default if the other parameters allow it; None if it
    depends on the seed."""

    def allows(self, value: object) -> bool:
        """Return whether a value has the type and lies in the range."""
        if self.type is bool or isinstance(value, bool):
            return self.type is bool and isinstance(value, bool)
        if not isinstance(value, int if self.type is int else Number):
            return False
        return (self.zero and value == 0) or self.minimum <= value <= self.maximum

    def __str__(self) -> str:
        if self.type is bool:
            return "true or false"
        what = "a whole number" if self.type is int else "a number"
        unit = f" ({self.unit})" if self.unit else ""
        zero = "0, or " if self.zero else ""
        return f"{zero}{what} from {self.minimum:g} to {self.maximum:g}{unit}"


def metres(default: float | None, minimum: Number, maximum: Number, *, zero: bool = False) -> Any:
    """Return a field for a length (m), which may also be 0 if `zero`.

    If `default` is None, the generator chooses the value.
    """
    allowed = ParameterRange(type=float, minimum=minimum, maximum=maximum, unit="m", zero=zero)
    return _field(default, allowed)


def fraction(default: float) -> Any:
    """Return a field for a number from 0 to 1."""
    return _field(default, ParameterRange(type=float))


def number(default: float, minimum: Number, maximum: Number) -> Any:
    """Return a field for a number without a unit."""
    return _field(default, ParameterRange(type=float, minimum=minimum, maximum=maximum))


def count(default: int | None, minimum: int, maximum: int, *, usual: int | None = None) -> Any:
    """Return a field for an integer.

    If `default` is None, the generator chooses the value: `usual` if that is possible.
    """
    allowed = ParameterRange(type=int, minimum=minimum, maximum=maximum, usual=usual)
    return _field(default, allowed)


def switch(default: bool) -> Any:
    """Return a field for a boolean."""
    return _field(default, ParameterRange(type=bool))


def _field(default: object, allowed: ParameterRange) -> Any:
    return dataclasses.field(default=default, metadata={"range": allowed})


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """The parameters of one kind of world.

    Raises:
        InputError: A value is of the wrong type or out of its range.
    """

    kind: ClassVar[str]
    """The kind's name in a world spec."""

    starts: int = count(1, 1, 50)
    """Number of starts from which episodes draw: the generator's own, and others at random."""
    people: int = count(0, 0, 50)
    """Number of people who walk through the rooms."""
    boxes: int = count(0, 0, 50)
    """Number of boxes that can be pushed."""

    def __post_init__(self) -> None:
        for name, allowed in self.ranges().items():
            value = getattr(self, name)
            if not allowed.allows(value) and not (value is None and self.defaults()[name] is None):
                raise InputError(f"random:{self.kind}", str(allowed), str(value), place=name)

    @classmethod
    def ranges(cls) -> dict[str, ParameterRange]:
        """Return type and range of each parameter, by name."""
        return {name: item.metadata["range"] for name, item in cls._fields().items()}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Return each parameter's default, by name; None means that the generator chooses."""
        return {name: item.default for name, item in cls._fields().items()}

    @classmethod
    def _fields(cls) -> dict[str, dataclasses.Field[Any]]:
        """Return the kind's own parameters, followed by those of all kinds."""
        common = {item.name: item for item in dataclasses.fields(Parameters)}
        own = {item.name: item for item in dataclasses.fields(cls) if item.name not in common}
        return own | common
