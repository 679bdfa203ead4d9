"""Seeing to what happened to a robot at a reading (chapter 4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.entering import enter
from albot_core.mappers.albot1.exits import Exits, leave_exits
from albot_core.mappers.albot1.following import ASTRAY, CROSSED, SUSPECTED, TROD
from albot_core.mappers.albot1.mapping import STEP, STRANGE, UPDATED_AT, UPDATES
from albot_core.mappers.albot1.memory import USED, VISIT, Memory, living
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.places import turned_round
from albot_core.mappers.albot1.recognition import moved
from albot_core.mappers.albot1.revisiting import find, recognize_place
from albot_core.mappers.albot1.sight import Sight
from albot_core.mappers.albot1.suspicion import suspicions
from albot_core.mappers.albot1.updating import update_map
from albot_core.mappers.albot1.visits import (
    allay,
    arouse_from,
    begin_visit,
    marked_visits,
    move_visits,
    renumber_visits,
    seen_in_visit,
)
from albot_core.matching.lines import merge_lines

VISITS_LOOKED_AFTER = 128
"""At each so many visits it is seen to which of them still matter."""


class Robot(NamedTuple):
    """All that one robot of many remembers; what is written here it remembers."""

    memory: Memory
    """Its map, with room for another view and another visit."""
    sight: Sight
    """Its last view."""
    exits: Exits
    """The exits that it has seen."""
    network: PlaceNetwork
    """Its network of places."""
    progress: np.ndarray
    """(5,) int64: how far it has come (see `mapping`)."""
    pose: np.ndarray
    """(3,) float64: where it believes to be (m, rad; the map's frame)."""
    next_id: int
    """The id that the next surface would have had before the last view."""

    @property
    def step(self) -> int:
        """How many views it has taken in."""
        return int(self.progress[STEP])

    @property
    def view(self) -> Segments:
        """What it sees, in its own frame (m; not a copy)."""
        return self.sight.surfaces[: self.sight.size[0]]


def attend(robot: Robot, events: int, limits: Limits) -> None:
    """See to what happened at its last reading, a sum of events (see `following`)."""
    if events & ASTRAY:
        _lose(robot, limits)
    elif events & CROSSED:
        _cross(robot, limits)
    elif events & SUSPECTED:
        if robot.network.lost_since:
            _find(robot)
        else:
            _suspect(robot)
    if events & TROD:
        robot.network.drop_breadcrumb(robot.pose, robot.view)


def _cross(robot: Robot, limits: Limits) -> None:
    """It has crossed an exit: remember the place left, and enter the next."""
    memory, sight, gate = robot.memory, robot.sight, robot.exits.gate
    line = gate[:4] if gate[4] > 0 else turned_round(gate[:4])
    _forget_visits(robot)
    robot.network.remember_place(robot.step, line, seen_in_visit(memory), sight.pose)
    leave_exits(robot.exits, *sight.pose[:2])
    begin_visit(memory, suspicions(robot.network, sight.pose))
    enter(memory, sight, limits)
    _note_update(robot)


def _forget_visits(robot: Robot) -> None:
    """Now and then forget the visits of which nothing more can come."""
    if len(robot.network.visits) % VISITS_LOOKED_AFTER == 0:
        kept = marked_visits(robot.memory)
        renumber_visits(robot.memory, robot.network.keep_visits(kept))


def _note_update(robot: Robot) -> None:
    """The last view was taken into the map."""
    robot.progress[UPDATED_AT] = robot.progress[STEP] - 1
    robot.progress[UPDATES] += 1
    robot.progress[STRANGE] = 0


def _suspect(robot: Robot) -> None:
    """It has met again many surfaces of an earlier visit: is it there?"""
    memory, network = robot.memory, robot.network
    met = memory.met[: len(network.visits)]
    step, pose = robot.step, robot.sight.pose
    met[:, 1] = suspicions(network, pose)
    allay(memory.met, memory.counts)
    if recognize_place(network, step, met, _before_it(robot), pose):
        arouse_from(memory, suspicions(network, pose))


def _before_it(robot: Robot) -> Segments:
    """The surfaces that it has seen in its present visit, those in view among them."""
    view = transform_segments(robot.sight.pose, robot.view)
    return merge_lines(seen_in_visit(robot.memory), view, robot.network.config.match)


def _lose(robot: Robot, limits: Limits) -> None:
    """It sees nothing of what should be there: it was moved, and begins anew where it is."""
    memory, sight, network = robot.memory, robot.sight, robot.network
    robot.exits.counts[:] = 0
    used = memory.counts[USED]
    before = memory.ids[:used] < robot.next_id
    present = memory.marks[:used] == memory.counts[VISIT]
    seen = memory.surfaces[:used][before & present & living(memory)]
    _forget_visits(robot)
    network.lose(robot.step, seen, sight.pose)
    begin_visit(memory, suspicions(network, sight.pose))
    update_map(memory, sight, limits)
    _note_update(robot)


def _find(robot: Robot) -> None:
    """It has lost its way, and looks where it may be."""
    memory, sight, network = robot.memory, robot.sight, robot.network
    first = network.lost_since
    motion = find(network, robot.step, _before_it(robot), sight.pose)
    if motion is None:
        return
    move_visits(memory, first, motion)
    moved(motion, sight.pose.copy(), sight.pose)
    robot.pose[:] = sight.pose
    robot.exits.counts[:] = 0
    arouse_from(memory, suspicions(network, robot.sight.pose))
