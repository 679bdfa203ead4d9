"""Recognising places visited again (algorithms 6 and 8), and which of them are candidates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int32

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.memory import NEVER
from albot_core.mappers.albot1.places.events import SEEN_THROUGH_EXIT, STANDS_WITHIN, EventKind
from albot_core.mappers.albot1.places.evidence import Evidence, weigh
from albot_core.mappers.albot1.places.merging import merge_here
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedPlace, Lines
from albot_core.matching.line_matching import LineMatch, match_lines

DOORSTEP = 5.0
"""A robot no farther from where it entered a place has just come in (m)."""


def recognize_place(
    network: PlaceNetwork,
    step: int,
    reobserved: Int32[np.ndarray, "visits 2"],
    seen: Segments,
    exits: Lines,
    pose: Pose,
) -> bool:
    """Compare the present place with the candidates, the likeliest first (algorithms 6 and 8).

    Args:
        network: The network of places.
        step: The view at which places are compared.
        reobserved: How many surfaces of each visit were observed again in the present one, and
            its gate (see `candidate_gates`).
        seen: The surfaces of the map that were seen in the present visit (m).
        exits: The exits that the robot remembers to have seen, in the map's frame (m).
        pose: Where the robot is in the map.

    Returns:
        Whether the present place was found to be that of an earlier visit.
    """
    network.compared_from = pose.copy()
    counts, gates = reobserved.T
    drift = network.drift_at(pose)
    stood_in: set[int] = set()
    for visit in _candidates(network, counts, gates):
        other, gate = network.places[network.visits[visit]], int(gates[visit])
        if gate == STANDS_WITHIN and counts[visit] > gate_of(other, network.config):
            gate = gate_of(other, network.config)
        by_position = gate == STANDS_WITHIN
        if by_position and other.id in stood_in:
            continue  # Where it stands now is the same for all visits.
        stood_in.add(other.id)
        map_to_graph = network.map_to_graph if by_position else network.visit_transforms[visit]
        guess = compose(map_to_graph, other.frame)
        config = network.config.match
        if by_position or network.config.expects_drift:
            config = replace(config, max_shift=min(config.max_shift, drift))
        match = match_lines(seen, other.surfaces, guess, pose, config)
        if by_position and match.matches == 0:
            continue  # It stands within many: that it is in none of them is not worth an event.
        evidence = None
        if network.config.min_probability > 0.0 and has_structure(match, network.config):
            evidence = weigh(network, match, other, guess, seen, exits, pose)
        accepted = _is_same(network, match, other, evidence, by_position, pose)
        kind = EventKind.RECOGNIZED if accepted else EventKind.REFUSED
        weighed = {} if evidence is None else evidence.weighed
        network.log.add_comparison(
            step, kind, network.current, other.id, match, int(counts[visit]), gate, **weighed
        )
        if accepted:  # Alg. 8, lines 12 and 13
            frame = _aligned(network, guess, match, seen, other, pose)
            merge_here(network, step, other, frame, pose)
            return True
    return False


def _candidates(
    network: PlaceNetwork,
    reobserved: Int32[np.ndarray, "visits"],
    gates: Int32[np.ndarray, "visits"],
) -> list[int]:
    """The visits that are candidates, those of which most was observed again first.

    Visits to one place of which nothing was observed again differ in nothing but the map's drift
    since: the last of them stands for all.
    """
    last = {place: visit for visit, place in enumerate(network.visits[:-1])}
    candidates = np.flatnonzero(reobserved > gates)
    ordered = candidates[np.argsort(-reobserved[candidates], kind="stable")].tolist()
    return [v for v in ordered if reobserved[v] > 0 or last[network.visits[v]] == v]


def _is_same(
    network: PlaceNetwork,
    match: LineMatch,
    place: LearnedPlace,
    evidence: Evidence | None,
    by_position: bool,
    pose: Pose,
) -> bool:
    """Whether the present place is another: by the evidence, where it was weighed."""
    config = network.config
    if evidence is not None:
        return evidence.probability >= config.min_probability
    least = config.min_share_here if by_position else config.min_share
    return match.share >= least and _is_confirmed(network, match, place, pose)


def _is_confirmed(network: PlaceNetwork, match: LineMatch, place: LearnedPlace, pose: Pose) -> bool:
    """Algorithm 6, and the robot would stand within the place.

    A place's description holds what is seen through its exits. So it may be next door otherwise.
    """
    config = network.config
    return (
        has_structure(match, config)
        and match.share >= config.min_share
        and place.holds(relative(match.pose, pose)[:2])
    )


def has_structure(match: LineMatch, config: PlacesConfig) -> bool:
    """Algorithm 6, line 11: more than 4 surfaces match, on both sides of the robot."""
    return match.matches > config.min_matches and min(match.left, match.right) > 0


def _aligned(
    network: PlaceNetwork,
    believed: Pose,
    found: LineMatch,
    seen: Segments,
    other: LearnedPlace,
    robot: Pose,
) -> Pose:
    """Where a recognised place's frame lies: where it was believed to, if that explains as much.

    An alignment by few surfaces is good to some 40 cm, the map is often better. So it is
    corrected only where fewer surfaces match without.
    """
    near = replace(
        network.config.match, max_shift=network.config.tolerance, max_turn=np.radians(10.0)
    )
    match = match_lines(seen, other.surfaces, believed, robot, near)
    return believed if match.matches >= found.matches - 1 else found.pose


def candidate_gates(network: PlaceNetwork, pose: Pose) -> Int32[np.ndarray, "visits"]:
    """Each visit's gate: with more surfaces observed again than this it becomes a candidate.

    What is observed again of a place that an exit joins to the present one is seen through that
    exit: such a place is never a candidate. The rest is ours, and needs no surface at all:

    - a place that was a candidate just before the robot crossed an exit into a new place
      (SEEN_THROUGH_EXIT): what was observed of it there is no longer in the map,
    - a place within which a robot that has just come into a new one believes to stand
      (STANDS_WITHIN),
    - all places, where the robot was carried away: it may be anywhere.

    Args:
        network: The network of places.
        pose: Where the robot is in the map.
    """
    gates = np.full(len(network.visits), NEVER, np.int32)
    if network.lost_since:
        gates[1:] = SEEN_THROUGH_EXIT
        return gates
    joined = {network.current, *(door.leads_to for door in network.here.exits)}
    by_place = {key: gate_of(place, network.config) for key, place in network.places.items()}
    by_place |= dict.fromkeys(_places_around(network, pose), STANDS_WITHIN)
    by_place |= dict.fromkeys(network.log.seen_through_exit(), SEEN_THROUGH_EXIT)
    by_place |= dict.fromkeys(joined, NEVER)
    gates[1:-1] = [by_place[place] for place in network.visits[1:-1]]
    return gates


def gate_of(place: LearnedPlace, config: PlacesConfig) -> int:
    """The gate of visits to a place: the thesis's n, which grows with the place (section 4.1.2)."""
    share = round(config.reobserved_share * len(place.surfaces))
    return min(max(share, config.min_reobserved), config.max_reobserved)


def _places_around(network: PlaceNetwork, pose: Pose) -> list[int]:
    """The places within whose surfaces a robot believes to stand that has just entered a new one.

    Within means in the box, turned as the place's frame, that holds them. A robot farther in than
    DOORSTEP would have recognised what it has seen.
    """
    if network.is_familiar or not network.config.candidates_by_position:
        return []
    if np.hypot(*relative(network.frame, pose)[:2]) > DOORSTEP:
        return []
    here = relative(network.map_to_graph, pose)
    return [key for key, place in network.places.items() if place.surrounds(*here[:2].tolist())]
