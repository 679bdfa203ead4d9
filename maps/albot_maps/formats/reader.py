"""World files of every format, told apart by name and content."""

from __future__ import annotations

from pathlib import Path

from albot_maps.formats.world_yaml import read_world_yaml
from albot_maps.world import World


def read_world(path: Path) -> World:
    """The world in a file.

    Raises:
        InputError: The file cannot be read, its format is not known, or it is wrong.
    """
    return read_world_yaml(path)
