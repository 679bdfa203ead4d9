"""Worlds: floor plans, readers of foreign formats, a catalogue, and random buildings."""

from albot_maps.formats.reader import read_world
from albot_maps.load import catalogue_names, load_world
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
    "catalogue_names",
    "load_world",
    "read_world",
]
