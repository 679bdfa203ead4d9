"""All that one robot of many remembers as arrays by name, to be saved and restored."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.exits import Exits, rebuilt_exits, stored_exits
from albot_core.mappers.albot1.memory import VISIT, Memory
from albot_core.mappers.albot1.memory_state import rebuilt_memory, stored_memory
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.network_state import rebuilt_network, stored_network
from albot_core.mappers.albot1.sight import Sight, rebuilt_sight, stored_sight

STANDING = ("progress", "since", "trod")
"""The rows of `following.Robots` from which, with its arrays, all others follow."""


def stored_arrays(
    memory: Memory, sight: Sight, exits: Exits, network: PlaceNetwork
) -> dict[str, np.ndarray]:
    """Copies of its arrays, as far as they are in use; `part.field` is each one's name."""
    parts = {
        "places": stored_network(network),
        "exits": stored_exits(exits),
        "memory": stored_memory(memory),
        "view": stored_sight(sight),
    }
    return {f"{part}.{name}": a for part, arrays in parts.items() for name, a in arrays.items()}


def rebuilt_arrays(
    state: Mapping[str, np.ndarray], config: PlacesConfig
) -> tuple[Memory, Sight, Exits, PlaceNetwork]:
    """What `stored_arrays` was given.

    Raises:
        InputError: The arrays contradict each other.
    """
    memory = rebuilt_memory(_part(state, "memory."))
    sight = rebuilt_sight(_part(state, "view."), len(state["memory.ids"]))
    exits = rebuilt_exits(_part(state, "exits."))
    network = rebuilt_network(_part(state, "places."), config)
    if len(network.visits) != memory.counts[VISIT] + 1:
        expected = f"the map's {memory.counts[VISIT]} visits"
        raise InputError("places.visits", expected, str(len(network.visits) - 1))
    return memory, sight, exits, network


def check_standing(state: Mapping[str, np.ndarray]) -> None:
    """See to it that the rows of STANDING can be restored.

    Raises:
        InputError: One cannot.
    """
    progress = state["progress"]
    if progress.shape != (5,) or (progress < 0).any():
        raise InputError("progress", "5 counts", str(progress.tolist()))
    for name in ("since", "trod"):
        if state[name].shape != (3,) or not np.isfinite(state[name]).all():
            raise InputError(name, "three finite numbers", str(state[name].tolist()))


def _part(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The arrays whose names begin with a prefix, without it."""
    return {
        name.removeprefix(prefix): array for name, array in state.items() if name.startswith(prefix)
    }
