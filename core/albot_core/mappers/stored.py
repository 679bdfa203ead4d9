"""What has a state that a schema declares: mappers, and parts of them.

`Stored` writes, checks and restores the state by the schema; `StoredMapper` is the common part of
mappers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.schema import Arrays, Schema, Sizes


class Stored:
    """What remembers the attributes that its schema declares: a mapper or a part of one.

    Four methods say what attributes cannot; by default they do nothing.
    """

    SCHEMA: Schema

    def _sizes(self) -> Sizes:
        """Return sizes that follow from the config, for its fields and rules."""
        return {}

    def _stored(self) -> Mapping[str, Any]:
        """Return the values of the fields that are no attributes."""
        return {}

    def _restored(self, state: Arrays) -> None:
        """Restore what the fields that are no attributes hold; all others are restored."""

    def _schema(self) -> tuple[Schema, Sizes]:
        """Return its schema with those of its parts, and all sizes."""
        own, sizes = self.SCHEMA, dict(self._sizes())
        parts = [getattr(self, name)._schema() for name in own.parts]
        for _, more in parts:
            sizes |= more
        fields = [field for schema, _ in parts for field in schema.fields]
        rules = [rule for schema, _ in parts for rule in schema.rules]
        return Schema(*own.fields, *fields, rules=(*rules, *own.rules)), sizes

    def state(self) -> dict[str, np.ndarray]:
        """Return everything it remembers, as arrays by name (copies)."""
        values = dict(self._stored())
        for field in self.SCHEMA.fields:
            if field.at is not None:
                values[field.name] = field.get(self)
        state = self.SCHEMA.arrays(values)
        for name in self.SCHEMA.parts:
            state |= getattr(self, name).state()
        return state

    def _set_state(self, state: Arrays) -> None:
        """Restore a state that has been checked."""
        for field in self.SCHEMA.fields:
            if field.at is not None:
                field.set(self, state[field.name])
        for name in self.SCHEMA.parts:
            getattr(self, name)._set_state(state)
        self._restored(state)

    def restore(self, state: Arrays) -> None:
        """Restore what `state` returned.

        Raises:
            InputError: The arrays are not a valid state; nothing is changed then.
        """
        schema, sizes = self._schema()
        schema.check(state, **sizes)
        self._set_state(state)


class StoredMapper(Stored):
    """The common part of mappers: config, name, and a state that a schema declares.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: Any

    def __init__(self, config: Any, name: str) -> None:
        self.config, self._name = config, name
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """The mapper's entry in the registry."""
        return mapper_spec(self._name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first."""
        raise NotImplementedError

    def _set_state(self, state: Arrays) -> None:
        """Restore a state that has been checked; the run continues as if never stopped."""
        self.reset(np.random.default_rng(0))
        super()._set_state(state)
