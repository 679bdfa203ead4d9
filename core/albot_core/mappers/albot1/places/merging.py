"""Merging of two places into one, with the exits of both and the places behind them."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import (
    compose,
    inverse,
    relative,
    transform_points,
    transform_segments,
)
from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import (
    MAX_DRIFT,
    LearnedExit,
    LearnedPlace,
    between,
    middle,
)


def merge_here(
    network: PlaceNetwork, step: int, other: LearnedPlace, frame: Pose, robot: Pose
) -> None:
    """Merge the robot's present place with another one, whose frame lies at `frame` in the map."""
    network.begin_leg(robot, is_aligned=True)
    here, mine = network.here, network.frame
    if other.id < here.id:
        network.map_to_graph = compose(frame, inverse(other.frame))
        _merge_places(network, step, other, here, relative(frame, mine))
    else:
        _merge_places(network, step, here, other, relative(mine, frame))
    network.version += 1


def _merge_places(
    network: PlaceNetwork, step: int, kept: LearnedPlace, gone: LearnedPlace, pose: Pose
) -> None:
    """Merge the place `gone` into `kept`; `pose` is that of its frame in the frame of `kept`.

    An exit that both places have leads to one place. If it leads to different places by the two
    descriptions, these are merged as well (Alg. 5, lines 12 and 13).
    """
    kept.describe(transform_segments(pose, gone.surfaces), network.config)
    first = len(kept.exits)
    for door in gone.exits:
        door.line = transform_segments(pose, door.line[None])[0]
        kept.exits.append(door)
    for place in network.places.values():
        for door in place.exits:
            if door.leads_to == gone.id:
                door.leads_to, door.exit_there = kept.id, door.exit_there + first
    _replace_place(network, gone, kept, pose)
    for _ in range(_most_passes(network)):
        if kept.id not in network.places or not _unite_exits(network, step, kept):
            break
    for place in network.places.values() if network.config.expects_drift else ():
        for _ in range(len(place.exits)):
            if not _drop_double(network, place):
                break


def _most_passes(network: PlaceNetwork) -> int:
    """Return the largest number of passes that can unite exits: each removes an exit or a place."""
    return sum(1 + len(place.exits) for place in network.places.values())


def _replace_place(
    network: PlaceNetwork, gone: LearnedPlace, kept: LearnedPlace, pose: Pose
) -> None:
    """Make all references to the place `gone` refer to `kept`."""
    del network.places[gone.id]
    # The pose of the kept frame in the map-to-graph transforms of visits to `gone`.
    moved = compose(compose(gone.frame, inverse(pose)), inverse(kept.frame))
    network.breadcrumbs.move(network.breadcrumbs.places == gone.id, inverse(moved), kept.id)
    network.stays = [
        (first, kept.id if place == gone.id else place) for first, place in network.stays
    ]
    for visit, place in enumerate(network.visits):
        if place == gone.id:
            network.visits[visit] = kept.id
            network.visit_transforms[visit] = compose(network.visit_transforms[visit], moved)
    network.current = kept.id if network.current == gone.id else network.current


def _unite_exits(network: PlaceNetwork, step: int, place: LearnedPlace) -> bool:
    """Merge two exits of a place that lie at one spot; return whether there were such exits."""
    for later, door in enumerate(place.exits):
        earlier = place.exit_at(door.line, later)
        if earlier is None:
            continue
        mine = place.exits[earlier]
        if mine.leads_to == door.leads_to:
            _drop_exit(network, network.places[door.leads_to], door.exit_there)
            _drop_exit(network, place, later)
            return True
        if not _are_joined(network, mine.leads_to, door.leads_to):
            _merge_behind(network, step, mine, door)
            return True
    return False


def _drop_double(network: PlaceNetwork, place: LearnedPlace) -> bool:
    """Drop an exit of the place that duplicates another one; return whether there was one.

    This is ours. Places that are merged after much drift may have one doorway twice, at positions
    that differ by more than SAME_EXIT. Two exits between the same two places are one if they are
    near each other on either side.
    """
    for later, door in enumerate(place.exits):
        there = network.places[door.leads_to]
        for mine in place.exits[:later]:
            if mine.leads_to != door.leads_to:
                continue
            beyond = there.exits[mine.exit_there].line, there.exits[door.exit_there].line
            if min(between(mine.line, door.line), between(*beyond)) < MAX_DRIFT:
                _drop_exit(network, there, door.exit_there)
                _drop_exit(network, place, later)
                return True
    return False


def _drop_exit(network: PlaceNetwork, place: LearnedPlace, index: int) -> None:
    """Drop an exit from a place's list; later exits move up, also in their partners' references."""
    del place.exits[index]
    for moved in place.exits[index:]:
        network.places[moved.leads_to].exits[moved.exit_there].exit_there -= 1


def _merge_behind(network: PlaceNetwork, step: int, mine: LearnedExit, theirs: LearnedExit) -> None:
    """Merge the two places to which one exit was found to lead."""
    first, second = sorted((mine, theirs), key=lambda door: door.leads_to)
    kept, gone = network.places[first.leads_to], network.places[second.leads_to]
    turn = gone.frame[2] - kept.frame[2]
    pose = np.array([0.0, 0.0, turn])
    there = transform_points(pose, middle(gone.exits[second.exit_there].line))
    pose[:2] = middle(kept.exits[first.exit_there].line) - there
    followed = Event(step=step, kind=EventKind.FOLLOWED, place=gone.id, other=kept.id)
    network.log.add(followed)
    if gone.id == network.current:
        network.map_to_graph = compose(compose(network.frame, inverse(pose)), inverse(kept.frame))
    _merge_places(network, step, kept, gone, pose)


def _are_joined(network: PlaceNetwork, one: int, other: int) -> bool:
    """Return whether an exit leads from one place to the other."""
    return any(door.leads_to == other for door in network.places[one].exits)
