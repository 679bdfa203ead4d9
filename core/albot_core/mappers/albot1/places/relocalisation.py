"""Relocalisation of a robot that was carried away, by all that it has seen since."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import (
    compose,
    inverse,
    relative,
    transform_segments,
)
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.contradictions import count_across, share_missing
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.evidence import NEAREST, lengthened, share_in_sight
from albot_core.mappers.albot1.places.hypothesis import Hypothesis, weighed
from albot_core.mappers.albot1.places.merging import merge_here
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedPlace
from albot_core.mappers.albot1.places.recognition import has_structure
from albot_core.matching.line_matching import (
    ALIKE,
    LineMatch,
    is_near,
    match_everywhere,
    match_lines,
)

MATCHES = 5
"""Number of alignments with each place that are considered."""
MOST = 12
"""Maximum number of hypotheses that are weighed, those with the most matching surfaces."""
NEARBY = 20.0
"""Known walls and ways are compared if their middle is at most this far from the robot (m)."""

Point = Float64[np.ndarray, "2"]


class Known(NamedTuple):
    """The knowledge from before the robot was carried away, in the graph frame (m)."""

    places: list[LearnedPlace]
    """The places."""
    walls: Segments
    """The surfaces of all of them."""
    exits: Segments
    """The exits of all places."""
    crumbs: Points
    """The breadcrumbs dropped in these places."""
    crumb_places: Int64[np.ndarray, "points"]
    """The id of each breadcrumb's place."""
    ways: Segments
    """The ways between linked breadcrumbs of these places, which are free."""

    @classmethod
    def of(cls, network: PlaceNetwork) -> Known:
        """Return what a lost robot knows from before it was carried away."""
        first, crumbs = network.visits[network.lost_since], network.breadcrumbs
        places = [place for place in network.places.values() if place.id < first]
        is_known = np.isin(crumbs.places, [place.id for place in places])
        ends = crumbs.tree.links[:, :2].astype(int)
        ways = crumbs.points[ends[is_known[ends].all(axis=1)]]
        return cls(
            places=places,
            walls=np.concatenate([transform_segments(p.frame, p.surfaces) for p in places]),
            exits=np.concatenate([transform_segments(p.frame, p.exit_lines) for p in places]),
            crumbs=crumbs.points[is_known],
            crumb_places=crumbs.places[is_known],
            ways=ways.reshape(-1, 4),
        )


def _near(lines: Segments, point: Point) -> Float64[np.ndarray, "near 4"]:
    """Return the lines whose middle is near a point (m)."""
    middles = 0.5 * (lines[:, :2] + lines[:, 2:])
    return np.asarray(lines[np.hypot(*(middles - point).T) < NEARBY])


class Sight(NamedTuple):
    """What a lost robot has seen, in the map's frame (m)."""

    seen: Segments
    """The surfaces seen since the robot was carried away, with those in view."""
    view: Segments
    """The surfaces in view."""
    pose: Pose
    """The robot's pose in the map."""


def relocalise(network: PlaceNetwork, step: int, sight: Sight) -> Pose | None:
    """Search the place of a robot that was carried away among all places known before.

    A hypothesis is accepted if it is probable enough, the robot stands in sight of where it has
    been before, the place there matches, and all of this was so before, at another spot.

    Args:
        network: The network of places.
        step: The view at which places are compared.
        sight: What the robot has seen since.

    Returns:
        The motion by which the part of the map made since must be moved to join the earlier map;
        None if no place is recognised.
    """
    pose = sight.pose
    network.compared_from = pose.copy()
    known = Known.of(network)
    network.hypotheses = find_hypotheses(network, known, sight)
    likeliest = max(network.hypotheses, key=lambda one: one.probability, default=None)
    if likeliest is None or not _is_probable(likeliest, network.config):
        return None
    place = _place_around(network, known, likeliest, pose)
    if place is None:
        return None
    match = _match_there(network, likeliest, place, sight)
    if not _is_alike(match, network.config) or not _is_confirmed(network, likeliest, pose):
        return None
    network.log.add_comparison(
        step,
        EventKind.RELOCALISED,
        network.current,
        place.id,
        match,
        probability=likeliest.probability,
    )
    return _join(network, step, place, match.pose, pose)


def find_hypotheses(network: PlaceNetwork, known: Known, sight: Sight) -> tuple[Hypothesis, ...]:
    """Align what was seen with each place known before, and weigh all alignments.

    Of alignments that put the robot at one spot, the one with the most matching surfaces is used.
    """
    seen, _, pose = sight
    found = [
        (place, match)
        for place in known.places
        for match in match_everywhere(seen, place.surfaces, pose, network.config.match, MATCHES)
    ]
    hypotheses: list[Hypothesis] = []
    for place, match in sorted(found, key=lambda pair: -pair[1].matches):
        map_to_graph = compose(match.pose, inverse(place.frame))
        if any(is_near(map_to_graph, one.map_to_graph, pose, ALIKE) for one in hypotheses):
            continue
        against = _contradictions(known, map_to_graph, sight, network.config.match.min_length)
        hypotheses.append(Hypothesis(place.id, match, map_to_graph, *against))
        if len(hypotheses) == MOST:
            break
    return weighed(hypotheses)


def _contradictions(
    known: Known, map_to_graph: Pose, sight: Sight, min_length: float
) -> tuple[float, int]:
    """Return the evidence against a hypothesis: share of missing walls, pieces across ways."""
    here, to_graph = relative(map_to_graph, sight.pose)[:2], inverse(map_to_graph)
    seen, view = (transform_segments(to_graph, walls) for walls in (sight.seen, sight.view))
    walls, ways = _near(known.walls, here), _near(known.ways, here)
    return (
        share_missing(walls, view, here, min_length),
        count_across(seen, walls, ways, min_length),
    )


def _place_around(
    network: PlaceNetwork, known: Known, hypothesis: Hypothesis, pose: Pose
) -> LearnedPlace | None:
    """Return the place in which the robot would stand: that of the nearest breadcrumb in its sight.

    None if none of the nearest breadcrumbs is in sight, because the robot would be where it has
    never been. If all breadcrumbs of the matching place are forgotten, that place is returned.
    """
    in_graph = relative(hypothesis.map_to_graph, pose)
    around = {
        place.id: place
        for place in known.places
        if place.holds(relative(place.frame, in_graph)[:2])
    }
    here = in_graph[:2]
    lines = np.concatenate((_near(known.walls, here), lengthened(known.exits)))
    order = np.argsort(np.hypot(*(known.crumbs - here).T), kind="stable")
    within = order[np.isin(known.crumb_places[order], list(around))]
    for which in within[:NEAREST].tolist():
        if share_in_sight(lines, known.crumbs[which][None], here[None]):
            return around[int(known.crumb_places[which])]
    is_forgotten = hypothesis.place not in known.crumb_places
    return around.get(hypothesis.place) if is_forgotten else None


def _match_there(
    network: PlaceNetwork, hypothesis: Hypothesis, place: LearnedPlace, sight: Sight
) -> LineMatch:
    """Match a place with what was seen, near its pose by a hypothesis."""
    guess = compose(hypothesis.map_to_graph, place.frame)
    near = replace(network.config.match, max_shift=ALIKE.max_shift, max_turn=ALIKE.max_turn)
    return match_lines(sight.seen, place.surfaces, guess, sight.pose, near)


def _is_alike(match: LineMatch, config: PlacesConfig) -> bool:
    """Return whether the place looks like what was seen: the thesis's rule, with more surfaces."""
    least = 0.0 if config.min_probability > 0.0 else config.min_share
    enough = match.matches >= config.min_relocalise_matches and match.share >= least
    return enough and has_structure(match, config)


def _is_probable(hypothesis: Hypothesis, config: PlacesConfig) -> bool:
    """Return whether a hypothesis is probable enough, where that counts."""
    least = config.min_relocalise_probability if config.min_probability > 0.0 else 0.0
    return hypothesis.probability >= least


def _is_confirmed(network: PlaceNetwork, hypothesis: Hypothesis, pose: Pose) -> bool:
    """Return whether a hypothesis was accepted before, from elsewhere; note it where it was not.

    Two looks from one spot have the same walls in view, and are mistaken together.
    """
    first, distance = network.first_look, network.config.confirming_distance
    if distance == 0.0:
        return True
    if first is None or not is_near(hypothesis.map_to_graph, first[:3], pose, ALIKE):
        network.first_look = np.concatenate((hypothesis.map_to_graph, pose))
        return False
    return bool(np.hypot(*(pose[:2] - first[3:5])) >= distance)


def _join(network: PlaceNetwork, step: int, place: LearnedPlace, found: Pose, pose: Pose) -> Pose:
    """Join all that was learned since the robot was lost to a place found at pose `found`.

    Returns the motion by which the part of the map made since must be moved.
    """
    first = network.visits[network.lost_since]
    learned = network.visit_transforms[network.visits.index(place.id)]
    motion = compose(compose(learned, place.frame), inverse(found))
    for unknown in network.places.values():
        if unknown.id >= first:
            frame = compose(motion, compose(network.map_to_graph, unknown.frame))
            unknown.frame = relative(learned, frame)
    back = compose(relative(learned, motion), network.map_to_graph)
    network.breadcrumbs.move(network.breadcrumbs.places >= first, back, None)
    network.map_to_graph, network.lost_since, network.hypotheses = learned, 0, ()
    network.first_look = None
    merge_here(network, step, place, compose(motion, found), compose(motion, pose))
    return motion
