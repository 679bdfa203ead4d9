"""Schemas of mappers' states: which arrays a state holds, and what each of them may hold.

A state comes from a file. Compiled code checks no bounds, and loops along surfaces: an invalid
shape or index could make it access memory that is not its own, or run for ever. So a mapper
declares its arrays once, and `Stored` writes, checks and restores them by that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.random_state import generator_of, generator_state
from albot_core.plain_data import LARGEST

LONGEST = 1000.0
"""Largest length of a surface, exit or link of a map (m); no robot's laser measures half as far."""
_MOST = 2**53
"""Largest whole number in a state; up to this, whole numbers are exact as floats."""
_SIZE = re.compile(r"(?:(\d+)\*)?([A-Za-z_.]+)([+-]\d+)?")

Arrays = Mapping[str, np.ndarray]
"""Arrays by name."""
Sizes = Mapping[str, Any]
"""Lengths of axes and other numbers by name: of named axes, of whole numbers in the state, and of
what the config says (`Stored._sizes`)."""
Number = float | int
Bound = Number | str | tuple[Number, ...] | None
"""A bound of numbers: a number, one for each column, or a size: `"readings"`, `"2*links"`,
`"visits+1"`. `"row"` is the row of a number itself."""
Rule = Callable[[Arrays, Sizes], None]
"""What fields cannot express: it raises InputError unless arrays, each valid, fit together."""


def refuse_unless(is_right: object, name: str, expected: str, found: object = "") -> None:
    """Raise InputError about an array unless something is true."""
    if not is_right:
        raise InputError(name, expected, str(found) or "others")


@dataclass(frozen=True)
class Field:
    """One array of a state, and which attribute it is kept in."""

    name: str
    """Name in the state."""
    shape: str = ""
    """Lengths of its axes, such as `"readings 3"`; empty for a single number. Axes with the same
    name have the same length, and `"visits+1"` is longer than `"visits"` by 1."""
    dtype: Any = float
    """Type of its numbers."""
    _: KW_ONLY
    at: str | None = ""
    """The attribute, such as `"_local.poses"`; by default `_` and the last part of the name. None
    if `_stored` makes the array and `_restored` takes it."""
    used: str = ""
    """The attribute that counts how many rows of the other are in use; empty for all."""
    least: Bound = None
    """Smallest number."""
    above: Bound = None
    """All numbers are larger than this."""
    most: Bound = None
    """Largest number."""
    below: Bound = None
    """All numbers are smaller than this: those that count the rows of `"links"` are below it."""
    finite: bool = True
    """Whether NaN and infinity are refused."""
    lengths: tuple[Number, Number] | None = None
    """Smallest and largest length of its line segments (m); NaN is ignored."""
    rising: bool = False
    """Whether its rows never fall."""
    once: bool = False
    """Whether its rows are all different."""
    sums: str = ""
    """Size that its numbers add up to; for several columns, one size each."""

    @property
    def _path(self) -> str:
        return self.at or f"_{self.name.rpartition('.')[2]}"

    def get(self, owner: object) -> Any:
        """Return the value of its attribute."""
        value = attrgetter(self._path)(owner)
        if isinstance(value, np.random.Generator):
            return generator_state(value)
        return value[: getattr(owner, self.used)] if self.used else value

    def set(self, owner: object, array: np.ndarray) -> None:
        """Set its attribute to a copy of an array, as the type that the attribute has."""
        *above, last = self._path.split(".")
        parent = attrgetter(".".join(above))(owner) if above else owner
        setattr(parent, last, _alike(getattr(parent, last), array))
        if self.used:
            setattr(owner, self.used, len(array))

    def array(self, value: Any) -> np.ndarray:
        """Return a value as an array of its type, also if it is an empty list (a copy)."""
        array = np.array(value, self.dtype)
        axes = self.shape.split()
        if array.size == 0 and array.ndim < len(axes):
            array = array.reshape(0, *map(int, axes[1:]))
        return array

    def check_type(self, array: np.ndarray) -> None:
        """Raise InputError unless an array has its type and number of axes."""
        dtype, axes = np.dtype(self.dtype), len(self.shape.split())
        if (array.dtype, array.ndim) != (dtype, axes):
            found = f"{array.ndim} of {array.dtype}"
            raise InputError(self.name, f"{axes} dimensions of {dtype}", found)
        most = {"f": LARGEST, "i": _MOST}.get(dtype.kind)
        if most and (np.abs(array[np.isfinite(array)]) > most).any():
            raise InputError(self.name, f"numbers within ±{most:g}", "others")

    def check_shape(self, array: np.ndarray, sizes: dict[str, Any]) -> None:
        """Raise InputError unless an array has its shape; lengths of new names are added."""
        axes = self.shape.split()
        for axis, found in zip(axes, array.shape, strict=True):
            if not axis.isdigit() and (named := _parsed(axis))[1] not in sizes:
                sizes[named[1]] = max(found - named[2], 0)
        wanted = [int(axis) if axis.isdigit() else _size(axis, sizes) for axis in axes]
        if array.shape != tuple(wanted):
            raise InputError(self.name, f"shape {tuple(wanted)}, ({self.shape})", str(array.shape))

    def check_values(self, array: np.ndarray, sizes: Sizes, name: str) -> None:
        """Raise InputError about `name` unless an array holds what it may hold."""
        if self.finite and not np.isfinite(array).all():
            raise InputError(name, "finite numbers", "NaN or infinity")
        self._check_range(array, sizes, name)
        if self.lengths is not None:
            lengths, (least, most) = np.hypot(*(array[:, 2:] - array[:, :2]).T), self.lengths
            wrong = (lengths < least) | (lengths > most)
            text = f"of {most:g} m at most" if least <= 0 else f"from {least:g} to {most:g} m"
            if wrong.any():
                raise InputError(name, f"line segments {text}", f"{lengths[wrong][0]:g} m")
        if self.rising and (np.diff(array, axis=0) < 0).any():
            raise InputError(name, "numbers that never fall", "others")
        if self.once and len(np.unique(array, axis=0)) < len(array):
            raise InputError(name, "each once", "one twice")
        if self.sums:
            wanted, found = [_size(size, sizes) for size in self.sums.split()], array.astype(int)
            totals = found.sum(axis=0).tolist() if len(wanted) > 1 else [int(found.sum())]
            refuse_unless(totals == wanted, name, f"numbers that add up to {wanted}", totals)

    def _check_range(self, array: np.ndarray, sizes: Sizes, name: str) -> None:
        sizes = {**sizes, "row": np.arange(array.size and len(np.atleast_1d(array)))}
        if array.ndim == 2:
            sizes["row"] = sizes["row"][:, None]
        is_flag = np.dtype(self.dtype).kind == "b"
        bounds = (
            (0 if is_flag else self.least, np.greater_equal, "from {}"),
            (self.above, np.greater, "above {}"),
            (1 if is_flag else self.most, np.less_equal, "to {}"),
            (self.below, np.less, "to less than {}"),
        )
        texts, wrong = [], np.zeros(array.shape, np.bool_)
        for bound, is_within, text in bounds:
            if bound is not None:
                value = _size(bound, sizes) if isinstance(bound, str) else bound
                texts.append(text.format(bound if isinstance(value, np.ndarray) else value))
                wrong |= ~is_within(array, value)
        if wrong.any():
            kind = "numbers" if array.dtype.kind == "f" else "whole numbers"
            raise InputError(name, f"{kind} {' '.join(texts)}", str(array[wrong][0]))


@dataclass(frozen=True, init=False)
class Pack(Field):
    """An array of several attributes, one after another."""

    members: tuple[Field, ...] = ()
    """The attributes: fields of a single number each, or of a fixed length."""

    def __init__(self, name: str, dtype: Any, *members: Field, at: str | None = "") -> None:
        length = sum(_length(member) for member in members)
        super().__init__(name, str(length), dtype, at=at)
        object.__setattr__(self, "members", members)

    def get(self, owner: object) -> Any:
        """Return the values of all attributes, one after another."""
        return np.concatenate([np.ravel(member.get(owner)) for member in self.members])

    def set(self, owner: object, array: np.ndarray) -> None:
        """Set all attributes."""
        for member, part in self.split(array):
            member.set(owner, part)

    def split(self, array: np.ndarray) -> list[tuple[Field, np.ndarray]]:
        """Return the members, each with its part of an array."""
        ends = np.cumsum([_length(member) for member in self.members])[:-1]
        parts = zip(self.members, np.split(array, ends), strict=True)
        return [(member, part if member.shape else part.reshape(())) for member, part in parts]

    def check_shape(self, array: np.ndarray, sizes: dict[str, Any]) -> None:
        """Raise InputError unless an array has its shape; its whole numbers become sizes."""
        super().check_shape(array, sizes)
        if array.dtype.kind == "i":
            sizes.update({member.name: int(part) for member, part in self.split(array)})

    def check_values(self, array: np.ndarray, sizes: Sizes, name: str) -> None:
        """Raise InputError unless each attribute's numbers are what they may be."""
        for member, part in self.split(array):
            try:
                member.check_values(np.asarray(part), sizes, name)
            except InputError as error:
                expected = f"{member.name}: {error.expected}"
                raise InputError(name, expected, error.found) from None


def lead_out(following: np.ndarray) -> bool:
    """Return whether following these row numbers leads to -1 from everywhere, and never round."""
    ahead = np.append(following, -1)
    for _ in range(len(ahead).bit_length()):
        ahead = ahead[ahead]  # Doubles the steps. The last element, at index -1, is -1.
    return bool((ahead == -1).all())


def generator(name: str) -> Field:
    """Return the field of a random generator."""
    words = (2**64 - 1,) * 4
    return Field(name, "6", np.uint64, at="_rng", most=(*words, 1, 2**32 - 1))


@dataclass(frozen=True, init=False)
class Schema:
    """What a state holds.

    Args:
        fields: Its arrays. A whole number is a size for the fields, besides the lengths of axes.
        parts: Attributes that are `Stored` themselves; their arrays belong to the state.
        rules: What the fields cannot express.
    """

    fields: tuple[Field, ...]
    parts: tuple[str, ...]
    rules: tuple[Rule, ...]

    def __init__(
        self, *fields: Field, parts: tuple[str, ...] = (), rules: tuple[Rule, ...] = ()
    ) -> None:
        for name, value in (("fields", fields), ("parts", parts), ("rules", rules)):
            object.__setattr__(self, name, value)

    @classmethod
    def like(cls, state: Arrays) -> Schema:
        """Return the schema of all states with the names and types of this one, of any lengths."""
        return cls(
            *(
                Field(name, " ".join(f"{name}.axis" for _ in array.shape), array.dtype)
                for name, array in state.items()
            )
        )

    def arrays(self, values: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the values of all fields as arrays of their types (copies)."""
        return {field.name: field.array(values[field.name]) for field in self.fields}

    def check_types(self, state: Arrays) -> None:
        """Check names, types and numbers of axes of a state's arrays.

        Raises:
            InputError: An array is missing or unknown, or of another type.
        """
        fields = {field.name: field for field in self.fields}
        for name in sorted(fields.keys() | state.keys()):
            refuse_unless(name in state, name, f"the array {name}", "none")
            refuse_unless(name in fields, name, f"only {', '.join(sorted(fields))}", name)
            fields[name].check_type(state[name])

    def check(self, state: Arrays, **sizes: Any) -> dict[str, Any]:
        """Check a state.

        Args:
            state: The arrays.
            sizes: Sizes that are known.

        Returns:
            All sizes.

        Raises:
            InputError: An array is not what this schema says; the error names the first.
        """
        self.check_types(state)
        for field in self.fields:
            if not field.shape and np.dtype(field.dtype).kind == "i":
                sizes[field.name] = int(state[field.name])
        for field in sorted(self.fields, key=lambda field: not isinstance(field, Pack)):
            field.check_shape(state[field.name], sizes)
        for field in self.fields:
            field.check_values(state[field.name], sizes, field.name)
        for rule in self.rules:
            rule(state, sizes)
        return sizes


def _alike(value: Any, array: np.ndarray) -> Any:
    """Return an array as a value of the same type as another (a copy)."""
    if isinstance(value, np.random.Generator):  # It may be in other hands, too.
        value.bit_generator.state = generator_of(array).bit_generator.state
        return value
    if isinstance(value, np.ndarray):
        return array.copy()
    if isinstance(value, list):
        return array.tolist() if array.ndim == 1 else list(array.copy())
    if isinstance(value, tuple):
        return value._make(array.tolist()) if hasattr(value, "_make") else tuple(array.tolist())
    return type(value)(array.item())


def _parsed(size: str) -> tuple[int, str, int]:
    """Return factor, name and added number of a size such as `2*links` or `visits+1`."""
    found = _SIZE.fullmatch(size)
    assert found is not None, size
    factor, name, more = found.groups()
    return int(factor or 1), name, int(more or 0)


def _size(size: str, sizes: Sizes) -> Any:
    factor, name, more = _parsed(size)
    return factor * sizes[name] + more


def _length(member: Field) -> int:
    return int(member.shape or 1)
