"""Going on in a map from any pose on it, as a robot does that has localised itself in a saved map.

No exit was crossed and nothing was driven between the pose at which the map was left and this one.
So the place that was left is closed, and a visit begins to the place around the robot: that of the
nearest breadcrumb within its exits; to a new place, if there is none.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.handle_events import RobotMemory
from albot_core.mappers.albot1.perceptual_map.memory import NOT_RECOGNIZED, VISIT
from albot_core.mappers.albot1.perceptual_map.viewing import take_view
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.recognition import candidate_gates, counting_visits
from albot_core.mappers.albot1.places.visits import begin_visit, enter_place, seen_since
from albot_core.sensing.view import ViewSettings, make_view_buffers


def resume_robot(
    robot: RobotMemory,
    pose: Pose,
    ranges: np.ndarray,
    settings: ViewSettings,
    limits: Albot1Limits,
) -> None:
    """Continue a robot's map at a pose.

    Args:
        robot: All that the robot remembers, with room for another view and another visit; changed.
        pose: Its pose on the map.
        ranges: The scan taken there (m).
        settings: Construction of views from scans.
        limits: All thresholds.
    """
    pm, view, network = robot.pm, robot.view, robot.network
    seen = seen_since(pm, int(pm.counts[VISIT]))
    network.resume(seen, pose, place_around(network, pose))
    take_view(ranges, settings, limits, view, make_view_buffers(len(ranges)))
    view.slots[: view.size[0]] = NOT_RECOGNIZED
    view.pose[:] = pose
    robot.pose[:] = pose
    robot.exits.counts[:] = 0
    begin_visit(pm, candidate_gates(network, pose), counting_visits(network))
    enter_place(pm, view, limits)
    robot.progress["step"] += 1
    robot.progress["updated_at"] = robot.progress["step"] - 1
    robot.progress["updates"] += 1
    robot.progress["inconsistent"] = 0


def place_around(network: PlaceNetwork, pose: Pose) -> int | None:
    """Return the place of the nearest breadcrumb within whose exits a pose of the map is."""
    here = network.in_graph_frame(pose)
    crumbs = network.breadcrumbs
    away = np.hypot(*(crumbs.points - here[:2]).T)
    for which in np.argsort(away, kind="stable").tolist():
        place = network.places.get(int(crumbs.places[which]))
        if place is not None and place.holds(relative(place.frame, here)[:2]):
            return place.id
    return None
