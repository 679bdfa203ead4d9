"""Configurations from plain data, such as YAML and JSON hold, and back.

A configuration is a frozen dataclass. What its fields may hold stands in their types, so that
nothing has to be listed anywhere else.
"""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, get_args, get_origin

from albot_core.errors import InputError
from albot_maps.formats.yaml_document import Steps, dotted, shown

Config = TypeVar("Config")

_NONE: Mapping[str, Any] = types.MappingProxyType({})


@dataclass(frozen=True)
class Where:
    """A place in plain data, for errors."""

    source: object
    """The file."""
    path: Steps = ()
    """Keys and indices from the top."""
    place: Callable[[Steps], str] = field(default=dotted)
    """How errors name a path."""

    def at(self, *steps: str | int) -> Where:
        """A place further in."""
        return dataclasses.replace(self, path=(*self.path, *steps))

    def error(self, expected: str, found: str) -> InputError:
        """What is wrong here."""
        return InputError(self.source, expected, found, place=self.place(self.path))


def read_config(kind: type[Config], data: Any, where: Where, base: Config | None = None) -> Config:
    """A configuration of a kind from a mapping of its fields.

    Args:
        kind: The dataclass.
        data: The mapping. Fields that it leaves out, and those of configurations inside, stay
            as they are in `base`.
        where: Where the data stands.
        base: A configuration to begin with; by default one with the defaults of all fields.

    Raises:
        InputError: The data is no mapping, leaves out a field that has no default, or holds a key
            that is no field or a value that its field does not take; it names the place.
    """
    hints = typing.get_type_hints(kind)
    fields = [each for each in dataclasses.fields(kind) if each.init]  # type: ignore[arg-type]
    bases = {
        each.name: _default(each) if base is None else getattr(base, each.name) for each in fields
    }
    values = read_fields({each.name: hints[each.name] for each in fields}, data, where, bases)
    for name, default in bases.items():
        if default is dataclasses.MISSING and name not in values:
            raise where.at(name).error("a value", "none")
    try:
        return kind(**(bases | values))
    except InputError as error:
        name = error.source.rpartition(".")[2]
        place = where.at(name) if name in bases else where
        raise place.error(error.expected, error.found) from None


def _default(each: dataclasses.Field[Any]) -> Any:
    """What a field holds where nothing is said; `MISSING` where something must be."""
    if each.default_factory is not dataclasses.MISSING:
        return each.default_factory()
    return each.default


def read_fields(
    known: Mapping[str, Any], data: Any, where: Where, bases: Mapping[str, Any] = _NONE
) -> dict[str, Any]:
    """The values of a mapping whose keys are known, each of the type that is known of it.

    Raises:
        InputError: As for `read_config`.
    """
    if not isinstance(data, Mapping):
        raise where.error(f"a mapping with {_listed(known)}", shown(data))
    for key in data:
        if key not in known:
            raise where.at(key).error(f"one of {_listed(known)}", f"{key}{hint(key, known)}")
    return {
        key: read_value(known[key], value, where.at(key), bases.get(key))
        for key, value in data.items()
    }


def read_value(kind: Any, data: Any, where: Where, base: Any = None) -> Any:
    """A value of a type; a configuration's fields that are left out are those of `base`.

    Raises:
        InputError: The data is none.
    """
    origin = get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        return _read_one_of(get_args(kind), data, where, base)
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
        return float(data)
    if (
        isinstance(kind, type)
        and isinstance(data, kind)
        and isinstance(data, bool) == (kind is bool)
    ):
        return data
    raise where.error(_name(kind), shown(data))


def _read_one_of(kinds: Iterable[Any], data: Any, where: Where, base: Any) -> Any:
    """A value of one of these types: the first that takes it."""
    kinds = [kind for kind in kinds if kind is not type(None)]
    if data is None:
        return None
    nested = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
    if isinstance(data, Mapping) and len(nested) == 1:
        return read_value(
            nested[0], data, where, base
        )  # Its error says more than that of them all.
    for kind in kinds:
        try:
            return read_value(kind, data, where)
        except InputError:
            continue
    raise where.error(" or ".join(map(_name, kinds)), shown(data))


def _read_tuple(kinds: tuple[Any, ...], data: Any, where: Where) -> tuple[Any, ...]:
    if not isinstance(data, list | tuple):
        raise where.error("a list", shown(data))
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(data)
    if len(data) != len(kinds):
        raise where.error(f"a list of {len(kinds)}", shown(data))
    return tuple(
        read_value(kind, value, where.at(k))
        for k, (kind, value) in enumerate(zip(kinds, data, strict=True))
    )


def plain(value: Any) -> Any:
    """A configuration, or a value in one, as plain data; `read_config` undoes it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Plain data with other plain data laid over it, mapping by mapping."""
    both = {
        key: merged(base[key], value)
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping)
        else value
        for key, value in over.items()
    }
    return {**base, **both}


def differences(one: Any, other: Any, path: Steps = ()) -> list[str]:
    """Where plain data differs from other plain data: `home_range 50, not 100`."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return [
            line
            for key in dict.fromkeys((*one, *other))
            for line in differences(one.get(key), other.get(key), (*path, key))
        ]
    return [] if one == other else [f"{dotted(path)} {shown(one)}, not {shown(other)}"]


def hint(name: object, known: Iterable[str]) -> str:
    """` (did you mean …?)`, or nothing where none of the names is near."""
    close = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.5)
    return f" (did you mean {close[0]}?)" if close else ""


def _listed(known: Iterable[str]) -> str:
    return ", ".join(sorted(known))


def _name(kind: Any) -> str:
    """A type in words."""
    if get_origin(kind) in (typing.Union, types.UnionType):
        return " or ".join(_name(each) for each in get_args(kind) if each is not type(None))
    if get_origin(kind) is not None:
        return "a mapping" if get_origin(kind) in (dict, Mapping) else "a list"
    words = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}
    return words.get(kind, getattr(kind, "__name__", str(kind)))
