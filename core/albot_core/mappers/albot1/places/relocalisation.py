"""Finding out where a robot is that was carried away: by all that it has seen since."""

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
"""So many alignments with each place are looked at."""
MOST = 12
"""So many hypotheses are weighed, those by which most surfaces are the same."""
NEARBY = 20.0
"""Known walls and ways with their middle so near to the robot are compared (m)."""

Point = Float64[np.ndarray, "2"]


class Known(NamedTuple):
    """What was known before the robot was carried away, in the graph frame (m)."""

    places: list[LearnedPlace]
    """The places."""
    walls: Segments
    """The surfaces of all of them."""
    exits: Segments
    """Their exits."""
    crumbs: Points
    """The breadcrumbs dropped there."""
    crumb_places: Int64[np.ndarray, "points"]
    """The id of the place that each is in."""
    ways: Segments
    """The ways between breadcrumbs linked there, which are free."""

    @classmethod
    def of(cls, network: PlaceNetwork) -> Known:
        """What a lost robot knows from before."""
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
    """The lines with their middle near a point (m)."""
    middles = 0.5 * (lines[:, :2] + lines[:, 2:])
    return np.asarray(lines[np.hypot(*(middles - point).T) < NEARBY])


class Sight(NamedTuple):
    """What a lost robot has seen, in the map's frame (m)."""

    seen: Segments
    """The surfaces seen since it was carried away, with those in view."""
    view: Segments
    """The surfaces in view."""
    pose: Pose
    """Where the robot is in the map."""


def relocalise(network: PlaceNetwork, step: int, sight: Sight) -> Pose | None:
    """Look for the place of a robot that was carried away among all places known before.

    It is believed where one hypothesis is probable enough, the robot stands in sight of where it
    has been before, and the place there matches.

    Args:
        network: The network of places.
        step: The view at which places are compared.
        sight: What the robot has seen since.

    Returns:
        How the map must be moved that was made since, so that it joins on to the map before; None
        where no place is recognised.
    """
    pose = sight.pose
    network.compared_from = pose.copy()
    known = Known.of(network)
    network.hypotheses = find_hypotheses(network, known, sight)
    likeliest = max(network.hypotheses, key=lambda one: one.probability, default=None)
    if likeliest is None or likeliest.probability < network.config.min_probability:
        return None
    place = _place_around(network, known, likeliest, pose)
    if place is None:
        return None
    match = _match_there(network, likeliest, place, sight)
    if not _is_alike(match, network.config):
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

    Of alignments that lay the robot at one spot the one is taken by which most surfaces are the
    same.
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
    """What speaks against a hypothesis: the share of walls missing, and the pieces across ways."""
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
    """The place in which a robot would stand: that of the nearest known breadcrumb in its sight.

    None where none of the nearest is in sight: then it would be where it has never been. But where
    all breadcrumbs of the place that matches are forgotten, that place is taken.
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
    """Match a place with what was seen, near where a hypothesis lays it."""
    guess = compose(hypothesis.map_to_graph, place.frame)
    near = replace(network.config.match, max_shift=ALIKE.max_shift, max_turn=ALIKE.max_turn)
    return match_lines(sight.seen, place.surfaces, guess, sight.pose, near)


def _is_alike(match: LineMatch, config: PlacesConfig) -> bool:
    """Whether the place looks like what was seen: the thesis's rule, for more surfaces."""
    least = 0.0 if config.min_probability > 0.0 else config.min_share
    enough = match.matches >= config.min_relocalise_matches and match.share >= least
    return enough and has_structure(match, config)


def _join(network: PlaceNetwork, step: int, place: LearnedPlace, found: Pose, pose: Pose) -> Pose:
    """Join all that was learned since on to a place whose frame was found at a pose of the map.

    Returns how the map must be moved that was made since.
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
    merge_here(network, step, place, compose(motion, found), compose(motion, pose))
    return motion
