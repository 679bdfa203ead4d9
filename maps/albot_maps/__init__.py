"""Worlds: floor plans, readers of foreign formats, a catalogue, and random buildings."""

from albot_maps.load import WorldSet, catalogue_names, load_world, load_worlds, read_world
from albot_maps.movables import Box, Door, Movables, Walker
from albot_maps.world import ROBOT_RADIUS, Exit, Room, World

__all__ = [
    "ROBOT_RADIUS",
    "Box",
    "Door",
    "Exit",
    "Movables",
    "Room",
    "Walker",
    "World",
    "WorldSet",
    "catalogue_names",
    "load_world",
    "load_worlds",
    "read_world",
]
