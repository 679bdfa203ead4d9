"""Handling of a robot's rare events at a reading, which concern its places (chapter 4)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose
from albot_core.mappers.albot1.perceptual_map.mapping import update_map
from albot_core.mappers.albot1.perceptual_map.memory import (
    CANDIDATE,
    GATE,
    USED,
    VISIT,
    LocatedView,
    PerceptualMap,
    living,
)
from albot_core.mappers.albot1.places.exits import ExitMemory, leave_exits
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import reversed_line
from albot_core.mappers.albot1.places.recognition import (
    candidate_gates,
    counting_visits,
    recognize_place,
)
from albot_core.mappers.albot1.places.relocalisation import Sight, relocalise
from albot_core.mappers.albot1.places.visits import (
    begin_visit,
    drop_candidates,
    enter_place,
    marked_visits,
    move_visits,
    renumber_visits,
    reset_candidates,
    seen_since,
)
from albot_core.mappers.albot1.step import BREADCRUMB, CROSSED, KIDNAPPED, REVISITING
from albot_core.matching.line_merging import merge_lines

FORGET_VISITS_EVERY = 128
"""Interval, in visits, at which visits that no longer matter are forgotten."""


class RobotMemory(NamedTuple):
    """All that one robot of many remembers. The arrays are the robot's own, not copies."""

    pm: PerceptualMap
    """The robot's map, with room for another view and another visit."""
    view: LocatedView
    """The robot's last view."""
    exits: ExitMemory
    """The exits that the robot has seen."""
    network: PlaceNetwork
    """The robot's network of places."""
    progress: Any
    """(5,) int64: the robot's counters (see `mapping`)."""
    pose: np.ndarray
    """(3,) float64: the robot's estimated pose (m, rad; the map's frame)."""
    next_id: int
    """The id that the next surface would have had before the last view."""

    @property
    def step(self) -> int:
        """The number of views processed."""
        return int(self.progress["step"])

    @property
    def walls(self) -> Segments:
        """The surfaces in the last view, in the robot's frame (m; not a copy)."""
        return self.view.surfaces[: self.view.size[0]]


def handle_events(robot: RobotMemory, events: int, limits: Albot1Limits) -> None:
    """Handle the events of a robot's last reading, a sum of event bits (see `step`)."""
    if events & KIDNAPPED:
        _start_anew(robot, limits)
    elif events & CROSSED:
        _cross_exit(robot, limits)
    elif events & REVISITING:
        if robot.network.lost_since:
            _relocalise(robot)
        else:
            _compare(robot)
    if events & BREADCRUMB:
        robot.network.drop_breadcrumb(robot.pose, robot.walls)


def _cross_exit(robot: RobotMemory, limits: Albot1Limits) -> None:
    """Remember the place that the robot leaves, and enter the next one (algorithms 5 and 7)."""
    pm, view, crossing = robot.pm, robot.view, robot.exits.crossing
    line = crossing[:4] if crossing[4] > 0 else reversed_line(crossing[:4])
    _forget_visits(robot)
    exits = robot.exits.lines[: robot.exits.counts[0]]
    seen = seen_since(pm, int(pm.counts[VISIT]))
    robot.network.remember_place(robot.step, line, seen, view.pose, exits)
    leave_exits(robot.exits, *view.pose[:2])
    begin_visit(pm, *_candidate_rules(robot))
    enter_place(pm, view, limits)  # Alg. 5, line 16
    _note_update(robot)
    if limits.compares_at_updates and pm.counts[CANDIDATE] > 0:
        _compare(robot)


def _candidate_rules(robot: RobotMemory) -> tuple[np.ndarray, np.ndarray]:
    """Return each visit's gate, and the visit for which its surfaces count."""
    return candidate_gates(robot.network, robot.view.pose), counting_visits(robot.network)


def _forget_visits(robot: RobotMemory) -> None:
    """Forget, at regular intervals, the visits in which no remembered surface was last seen."""
    if len(robot.network.visits) % FORGET_VISITS_EVERY == 0:
        kept = marked_visits(robot.pm)
        renumber_visits(robot.pm, robot.network.keep_visits(kept))


def _note_update(robot: RobotMemory) -> None:
    """Count the update by which the last view was laid over the map."""
    robot.progress["updated_at"] = robot.progress["step"] - 1
    robot.progress["updates"] += 1
    robot.progress["inconsistent"] = 0


def _compare(robot: RobotMemory) -> None:
    """Compare the present place with the candidates for a loop closure (algorithms 6 and 8)."""
    pm, network = robot.pm, robot.network
    reobserved = pm.reobserved[: len(network.visits)]
    step, pose = robot.step, robot.view.pose
    reobserved[:, GATE] = candidate_gates(network, pose)
    drop_candidates(pm)
    exits = robot.exits.lines[: robot.exits.counts[0]]
    seen = _seen_from(robot, int(pm.counts[VISIT]))
    if recognize_place(network, step, reobserved[:, : GATE + 1], seen, exits, pose):
        reset_candidates(pm, *_candidate_rules(robot))


def _seen_from(robot: RobotMemory, visit: int) -> Segments:
    """Return the surfaces seen since a visit began, with those in view (map frame)."""
    view = transform_segments(robot.view.pose, robot.walls)
    return merge_lines(seen_since(robot.pm, visit), view, robot.network.config.match)


def _start_anew(robot: RobotMemory, limits: Albot1Limits) -> None:
    """Start a new place for a robot that was carried away.

    Only what it saw before the last view describes the place that it left.
    """
    pm, view, network = robot.pm, robot.view, robot.network
    robot.exits.counts[:] = 0
    used = pm.counts[USED]
    before = pm.ids[:used] < robot.next_id
    present = pm.marks[:used] == pm.counts[VISIT]
    seen = pm.surfaces[:used][before & present & living(pm)]
    _forget_visits(robot)
    network.start_anew(robot.step, seen, view.pose)
    begin_visit(pm, *_candidate_rules(robot))
    update_map(pm, view, limits)
    _note_update(robot)


def _relocalise(robot: RobotMemory) -> None:
    """Compare all that a robot has seen since it was carried away with all known places."""
    pm, view, network = robot.pm, robot.view, robot.network
    first = network.lost_since
    in_view = transform_segments(view.pose, robot.walls)
    sight = Sight(seen=_seen_from(robot, first), view=in_view, pose=view.pose)
    motion = relocalise(network, robot.step, sight)
    if motion is None:
        return
    move_visits(pm, first, motion)
    compose_pose(motion, view.pose.copy(), view.pose)
    robot.pose[:] = view.pose
    robot.exits.counts[:] = 0
    reset_candidates(pm, *_candidate_rules(robot))
