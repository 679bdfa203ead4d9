"""Specs of random worlds, such as `random:office:42?rooms=12&clutter=0.3`."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from albot_core.errors import InputError, did_you_mean
from albot_maps.generators.parameters import Parameters
from albot_maps.generators.plan import Sampler
from albot_maps.generators.populate import populate, scatter_starts
from albot_maps.world import ROBOT_RADIUS, World

KINDS = ("apartment", "hall", "maze", "office", "ring", "warehouse")
"""The kinds of random worlds."""

PREFIX = "random:"
"""Prefix of the spec of a random world."""

_FORM = "random:KIND:SEED?KEY=VALUE&…"
_LARGEST_SEED = 2**64 - 1


@dataclass(frozen=True, kw_only=True)
class RandomSpec:
    """The spec of a random world, parsed."""

    kind: str
    """One of `KINDS`."""
    seed: int
    """From 0 to 2⁶⁴ − 1."""
    parameters: Parameters
    """The given parameters, and defaults for the others."""

    def __str__(self) -> str:
        """Return the spec as text, with the parameters that differ from their defaults."""
        defaults = self.parameters.defaults()
        asked = "&".join(
            f"{name}={_text(value)}"
            for name, default in defaults.items()
            if (value := getattr(self.parameters, name)) != default
        )
        return f"{PREFIX}{self.kind}:{self.seed}{'?' if asked else ''}{asked}"

    def make(self, robot_radius: float = ROBOT_RADIUS) -> World:
        """Generate the world; a spec gives the same world on every machine.

        The walls depend on the spec alone, starts and movables also on the robot's radius (m).

        Raises:
            InputError: What the parameters request does not fit, or the robot does not fit.
        """
        draw = getattr(_module(self.kind), f"draw_{self.kind}")
        sampler = Sampler(np.random.Generator(np.random.PCG64(self.seed)))
        plan, start = draw(self.parameters, sampler, str(self))
        world = plan.world(f"{self.kind}-{self.seed}", str(self), start, robot_radius)
        return populate(scatter_starts(world, self.parameters, sampler), self.parameters, sampler)


def parse_spec(text: str) -> RandomSpec:
    """Parse the spec of a random world.

    Raises:
        InputError: The text does not have the form of a spec, the kind or a parameter is unknown,
            or a value is out of its range.
    """
    body, _, query = text.removeprefix(PREFIX).partition("?")
    kind, colon, seed = body.partition(":")
    known = parameters_of(kind)
    if not colon:
        raise InputError(text, f"the form {_FORM}", "no seed")
    whole = seed.isascii() and seed.isdecimal() and len(seed) <= len(str(_LARGEST_SEED))
    if not whole or int(seed) > _LARGEST_SEED:
        raise InputError(text, f"a whole number from 0 to {_LARGEST_SEED}", seed, place="seed")
    values: dict[str, str] = {}
    for item in query.split("&") if query else ():
        name, equals, value = item.partition("=")
        if not equals:
            raise InputError(text, f"the form {_FORM}", repr(item))
        if name in values:
            raise InputError(text, "each parameter once", f"{name} twice", place=name)
        values[name] = value
    return RandomSpec(kind=kind, seed=int(seed), parameters=read_parameters(known, values))


def seeded(spec: str, seed: int) -> str:
    """Return `random:KIND` or `random:KIND?…` with the seed added; any other spec unchanged."""
    body, mark, query = spec.partition("?")
    if not body.startswith(PREFIX) or ":" in body.removeprefix(PREFIX):
        return spec
    return f"{body}:{seed}{mark}{query}"


def parameters_of(kind: str) -> type[Parameters]:
    """Return the dataclass of a kind's parameters.

    Raises:
        InputError: There is no such kind.
    """
    if kind not in KINDS:
        found = f"{kind or 'nothing'}{did_you_mean(kind, KINDS)}"
        raise InputError("random world", f"one of the kinds {', '.join(KINDS)}", found)
    known: type[Parameters] = getattr(_module(kind), f"{kind.capitalize()}Parameters")
    return known


def read_parameters(known: type[Parameters], values: Mapping[str, str]) -> Parameters:
    """Parse the parameters of one kind from text.

    Raises:
        InputError: A parameter is unknown, or its value has the wrong type or range.
    """
    ranges = known.ranges()
    read: dict[str, Any] = {}
    for name, value in values.items():
        if name not in ranges:
            found = f"{name or 'nothing'}{did_you_mean(name, ranges)}"
            raise InputError(f"{PREFIX}{known.kind}", f"one of {', '.join(ranges)}", found)
        try:
            kind = ranges[name].type
            read[name] = {"true": True, "false": False}[value] if kind is bool else kind(value)
        except (KeyError, ValueError):
            source, expected = f"{PREFIX}{known.kind}", str(ranges[name])
            raise InputError(source, expected, value or "nothing", place=name) from None
    return known(**read)


def _module(kind: str) -> Any:
    return importlib.import_module(f"albot_maps.generators.{kind}")


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
