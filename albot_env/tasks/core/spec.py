"""Specs of environments that JSON can hold, however their settings were given."""

from __future__ import annotations

import copy
import dataclasses
import json
from collections.abc import Mapping
from typing import Any

from gymnasium.envs.registration import EnvSpec

from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_env.faults.registry import faults_text
from albot_maps import World, WorldSet


class ConfiguredSpec(EnvSpec):
    """A gymnasium spec whose `to_json` writes configurations as mappings of their fields.

    `gymnasium.make(EnvSpec.from_json(spec.to_json()))` makes the same environment again. That is
    how Minari stores the environment of a data set.
    """

    @classmethod
    def of(cls, spec: EnvSpec) -> ConfiguredSpec:
        """Return a spec with the same fields."""
        fields = [each.name for each in dataclasses.fields(spec) if each.init]
        found = cls(**{name: getattr(spec, name) for name in fields})
        # The caller may change a mapping later.
        found.kwargs = {
            name: copy.deepcopy(value) if isinstance(value, Mapping) else value
            for name, value in spec.kwargs.items()
        }
        return found

    def to_json(self) -> str:
        """Return the spec as JSON text.

        Raises:
            InputError: JSON cannot hold a setting, such as a world that is an object; the error
                names the setting.
        """
        plain = copy.copy(self)
        plain.kwargs = {name: _plain(name, value, self.id) for name, value in self.kwargs.items()}
        return super(ConfiguredSpec, plain).to_json()


def _plain(name: str, value: Any, environment: str) -> Any:
    """Return a setting as plain data."""
    if _holds_world(value):
        expected = "a world spec, such as the path of a world file, for the JSON of the environment"
        raise InputError(environment, expected, f"a {_class_of(value)}", place=name)
    plain = faults_text(value) if name == "faults" and value is not None else to_plain(value)
    try:
        json.dumps(plain)
    except (TypeError, ValueError) as error:
        expected = "a value that JSON can hold, for the JSON of the environment"
        raise InputError(environment, expected, f"{value!r} ({error})", place=name) from None
    return plain


def _holds_world(value: Any) -> bool:
    items = value if isinstance(value, list | tuple) else (value,)
    return any(isinstance(item, World | WorldSet) for item in items)


def _class_of(value: Any) -> str:
    """Return the class of a world; of the first world among several."""
    items = value if isinstance(value, list | tuple) else (value,)
    return next(type(item).__name__ for item in items if isinstance(item, World | WorldSet))
