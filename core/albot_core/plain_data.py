"""Convert configurations from plain data, such as that of YAML and JSON, and back.

A configuration is a frozen dataclass whose type hints say what its fields may hold. A value of
another type is an error and never converted (cattrs turns 3.9 and True into integers), and so is an
unknown key (which msgspec ignores). The error names the file, the place in it, what was expected
and what was found.
"""

from __future__ import annotations

import dataclasses
import enum
import reprlib
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import PurePath
from typing import Any, TypeVar, get_args, get_origin

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError, did_you_mean
from albot_core.yaml_document import KeyPath, dotted, format_value

Config = TypeVar("Config")

_NONE: Mapping[str, Any] = types.MappingProxyType({})


@dataclass(frozen=True)
class Location:
    """The place of plain data in a file, for errors."""

    source: object
    """The file."""
    path: KeyPath = ()
    """Keys and indices from the top."""
    place: Callable[[KeyPath], str] = field(default=dotted)
    """Turns a path into the text for errors."""

    def at(self, *steps: str | int) -> Location:
        """Return the location of a key or an index within this one."""
        return dataclasses.replace(self, path=(*self.path, *steps))

    def error(self, expected: str, found: str) -> InputError:
        """Return an error for this location."""
        return InputError(self.source, expected, found, place=self.place(self.path))

    @contextmanager
    def relocate_errors(self, names: Collection[str] | None = None) -> Iterator[None]:
        """Let errors raised by a dataclass in the block name the place in the file.

        Args:
            names: The fields of the data at this location; None for all fields.
        """
        try:
            yield
        except InputError as error:
            name = error.source.rpartition(".")[2]
            place = self.at(name) if names is None or name in names else self
            raise place.error(error.expected, error.found) from None


def read_config(
    kind: type[Config], data: Any, where: Location, base: Config | None = None
) -> Config:
    """Parse a configuration from a mapping of its fields.

    Args:
        kind: The dataclass.
        data: The mapping. Missing fields, also those of nested configurations, are taken from
            `base`.
        where: Location of the data.
        base: The configuration to start from; by default, the defaults of all fields.

    Raises:
        InputError: The data is not a mapping, lacks a field without a default, or has an unknown
            key or an invalid value; the error names the place.
    """
    hints = typing.get_type_hints(kind)
    fields = [each for each in dataclasses.fields(kind) if each.init]  # type: ignore[arg-type]
    bases = {}
    for each in fields:
        if base is not None:
            bases[each.name] = getattr(base, each.name)
        elif each.default_factory is not dataclasses.MISSING:
            bases[each.name] = each.default_factory()
        else:
            bases[each.name] = each.default
    values = read_fields({each.name: hints[each.name] for each in fields}, data, where, bases)
    for name, default in bases.items():
        if default is dataclasses.MISSING and name not in values:
            raise where.at(name).error("a value", "none")
    with where.relocate_errors(bases):
        return kind(**(bases | values))


def read_fields(
    known: Mapping[str, Any], data: Any, where: Location, bases: Mapping[str, Any] = _NONE
) -> dict[str, Any]:
    """Parse the values of a mapping; `known` gives the type of each allowed key.

    Raises:
        InputError: As for `read_config`.
    """
    if not isinstance(data, Mapping):
        raise where.error(f"a mapping with {_listed(known)}", format_value(data))
    for key in data:
        if key not in known:
            found = f"{key}{did_you_mean(key, known)}"
            raise where.at(key).error(f"one of {_listed(known)}", found)
    return {
        key: read_value(known[key], value, where.at(key), bases.get(key))
        for key, value in data.items()
    }


def read_record(
    known: Mapping[str, Any], data: Any, where: Location, *, others: bool = False
) -> dict[str, Any]:
    """Parse the values of a mapping that must have all known keys.

    Args:
        known: The types of the values, by key.
        data: The mapping.
        where: Location of the data.
        others: Whether other keys are allowed, which are ignored.

    Raises:
        InputError: As for `read_config`; or a key is missing.
    """
    if others and isinstance(data, Mapping):
        data = {key: data[key] for key in known if key in data}
    values = read_fields(known, data, where)
    for name in known:
        if name not in values:
            raise where.at(name).error("a value", "none")
    return values


LARGEST = 1e12
"""Largest absolute coordinate, length, angle or time (m, rad, s)."""


def read_array(
    shape: tuple[int | None, ...], data: Any, where: Location
) -> Float64[np.ndarray, "..."]:
    """Parse nested lists of finite numbers within ±`LARGEST` as an array.

    Args:
        shape: The lengths of the axes; None for any length.
        data: The nested lists.
        where: Location of the data.

    Raises:
        InputError: The data is anything else.
    """
    lengths = " x ".join("n" if length is None else str(length) for length in shape)
    expected = f"{lengths} numbers within ±{LARGEST:g}".strip()
    try:
        array = np.array(data)
    except ValueError:
        raise where.error(expected, "lists of different lengths") from None
    if not array.size and shape[:1] == (None,) and array.ndim == 1:
        array = np.empty((0, *(length or 0 for length in shape[1:])))
    right = array.ndim == len(shape) and all(
        length in (None, found) for length, found in zip(shape, array.shape, strict=True)
    )
    if not right or array.dtype.kind not in "iuf" or not (np.abs(array) <= LARGEST).all():
        raise where.error(expected, format_value(data))
    return array.astype(np.float64)


def read_value(kind: Any, data: Any, where: Location, base: Any = None) -> Any:
    """Parse a value of a type; missing fields of a configuration are taken from `base`.

    Raises:
        InputError: The data has another type.
    """
    origin = get_origin(kind)
    if origin in (typing.Union, types.UnionType, typing.Literal):
        read = _read_choice if origin is typing.Literal else _read_union
        return read(get_args(kind), data, where, base)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return read_config(kind, data, where, base if isinstance(base, kind) else None)
    if origin is tuple:
        return _read_tuple(get_args(kind), data, where)
    if origin in (list, Sequence) and isinstance(data, list):
        (each,) = get_args(kind)
        return [read_value(each, value, where.at(k)) for k, value in enumerate(data)]
    if origin in (dict, Mapping) and isinstance(data, Mapping):
        _, each = get_args(kind)
        return {key: read_value(each, value, where.at(key)) for key, value in data.items()}
    if kind is Any:
        return data
    if kind is float and isinstance(data, int | float) and not isinstance(data, bool):
        try:
            return float(data)
        except OverflowError:
            raise where.error("a number", "one that is too large") from None
    if (
        isinstance(kind, type)
        and isinstance(data, kind)
        and isinstance(data, bool) == (kind is bool)
    ):
        return data
    raise where.error(name_type(kind), format_value(data))


def _read_choice(values: tuple[Any, ...], data: Any, where: Location, _: Any) -> Any:
    """Parse one of several values."""
    if any(type(data) is type(value) and data == value for value in values):
        return data
    found = f"{format_value(data)}{did_you_mean(data, map(str, values))}"
    raise where.error(f"one of {', '.join(map(str, values))}", found)


def _read_union(kinds: Iterable[Any], data: Any, where: Location, base: Any) -> Any:
    """Parse a value of the first type that fits."""
    kinds = [kind for kind in kinds if kind is not type(None)]
    if data is None:
        return None
    nested = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
    if isinstance(data, Mapping) and len(nested) == 1:
        # Its error is more specific than that of the union.
        return read_value(nested[0], data, where, base)
    for kind in kinds:
        try:
            return read_value(kind, data, where)
        except InputError:
            continue
    raise where.error(" or ".join(map(name_type, kinds)), format_value(data))


def _read_tuple(kinds: tuple[Any, ...], data: Any, where: Location) -> tuple[Any, ...]:
    if not isinstance(data, list | tuple):
        raise where.error("a list", format_value(data))
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(data)
    if len(data) != len(kinds):
        raise where.error(f"a list of {len(kinds)}", format_value(data))
    return tuple(
        read_value(kind, value, where.at(k))
        for k, (kind, value) in enumerate(zip(kinds, data, strict=True))
    )


def to_plain(value: Any) -> Any:
    """Convert a configuration, or a value in one, to plain data; `read_config` is the inverse.

    Numbers and arrays of numpy become numbers and lists, paths become text, and members of an
    enumeration their values. Any other value is returned unchanged.
    """
    if isinstance(value, enum.Enum):
        return to_plain(value.value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, PurePath):
        return str(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            each.name: to_plain(getattr(value, each.name)) for each in dataclasses.fields(value)
        }
    if isinstance(value, Mapping):
        return {str(key): to_plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(each) for each in value]
    return value


@cache
def _field_hints(kind: Any) -> Mapping[str, Any]:
    """Return the types of a configuration's fields, by name; they are worked out once a class."""
    return types.MappingProxyType(typing.get_type_hints(kind))


def check_types(config: Any) -> None:
    """Check what configurations that are made in Python do not check themselves.

    They check their numbers and texts. Here it is that a field for another configuration holds one,
    and that what is to be true or false is that: the text "no" would count as true.

    Raises:
        InputError: A field has a value of another type; the error names class and field.
    """
    kind: Any = type(config)
    hints = _field_hints(kind)
    for each in dataclasses.fields(config):
        name, hint, value = each.name, hints[each.name], getattr(config, each.name)
        where = Location(f"{type(config).__name__}.{name}")
        kinds = _alternatives(hint)
        holds_config = any(dataclasses.is_dataclass(kind) for kind in kinds)
        if not holds_config or not all(isinstance(kind, type) for kind in kinds):
            if bool in kinds:
                read_value(hint, to_plain(value), where)
        elif not isinstance(value, kinds):
            expected = " or ".join(
                "None" if kind is type(None) else kind.__name__ for kind in kinds
            )
            raise where.error(expected, f"a {type(value).__name__}, {reprlib.repr(value)}")
        elif value is not None:
            check_types(value)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    """Return the types that a hint allows: those of a union, or itself."""
    is_union = get_origin(hint) in (typing.Union, types.UnionType)
    return get_args(hint) if is_union else (hint,)


def changed_fields(config: Any, default: Any) -> dict[str, Any]:
    """Return the fields that differ from another configuration of the class, as plain data."""
    changed: dict[str, Any] = {}
    for each in dataclasses.fields(config):
        mine, its = getattr(config, each.name), getattr(default, each.name)
        if dataclasses.is_dataclass(mine) and type(mine) is type(its):
            if inner := changed_fields(mine, its):
                changed[each.name] = inner
        elif mine != its:
            changed[each.name] = float(mine) if isinstance(mine, float) else to_plain(mine)
    return changed


def deep_merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain data overridden by other plain data, recursively for mappings."""
    both = {
        key: deep_merge(base[key], value)
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping)
        else value
        for key, value in over.items()
    }
    return {**base, **both}


def differences(one: Any, other: Any, path: KeyPath = ()) -> list[str]:
    """Return the differences between plain data as text: `home_range 50, not 100`.

    Of lists that are too long to be shown, it is what only one of them has.
    """
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return [
            line
            for key in dict.fromkeys((*one, *other))
            for line in differences(one.get(key), other.get(key), (*path, key))
        ]
    if one == other:
        return []
    if isinstance(one, list) and isinstance(other, list):
        told = _list_difference(one, other)
    else:
        told = f"{format_value(one)}, not {format_value(other)}"
    return [f"{dotted(path)} {told}"]


def _list_difference(one: list[Any], other: list[Any]) -> str:
    """Return how a list differs from another."""
    if not any(format_value(each).endswith("...") for each in (one, other)):
        return f"{format_value(one)}, not {format_value(other)}"
    more, missing = _without(one, other), _without(other, one)
    if more or missing:
        both = (("with", more), ("without", missing))
        return " and ".join(f"{word} {format_value(some)}" for word, some in both if some)
    pairs = enumerate(zip(one, other, strict=True))
    number, (mine, its) = next((k, pair) for k, pair in pairs if pair[0] != pair[1])
    return f"in another order, the first [{number}]: {format_value(mine)}, not {format_value(its)}"


def _without(some: list[Any], others: list[Any]) -> list[Any]:
    """Return a list without as many of each value as another one has."""
    left = list(others)
    kept = []
    for each in some:
        if each in left:
            left.remove(each)
        else:
            kept.append(each)
    return kept


def _listed(known: Iterable[str]) -> str:
    return ", ".join(sorted(known))


def name_type(kind: Any) -> str:
    """Return in words which values a type has: `a number`, `one of ppo, recurrent_ppo`."""
    if get_origin(kind) in (typing.Union, types.UnionType):
        return " or ".join(name_type(each) for each in get_args(kind) if each is not type(None))
    if get_origin(kind) is typing.Literal:
        return f"one of {', '.join(map(str, get_args(kind)))}"
    if get_origin(kind) is not None:
        return "a mapping" if get_origin(kind) in (dict, Mapping) else "a list"
    words = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}
    return words.get(kind, getattr(kind, "__name__", str(kind)))
