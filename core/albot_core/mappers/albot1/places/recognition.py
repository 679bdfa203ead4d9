"""Recognition of places visited again (algorithms 6 and 8), and the choice of candidates."""

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
from albot_core.matching.line_matching import LineMatch, MatchConfig, match_first, match_lines

DOORSTEP = 5.0
"""A robot no farther than this from where it entered a place has just entered it (m)."""


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
        reobserved: Number of surfaces of each visit that were observed again in the present one,
            and the visit's gate (see `candidate_gates`).
        seen: The surfaces of the map that were seen in the present visit (m).
        exits: The remembered exits that the robot has seen, in the map's frame (m).
        pose: The robot's pose in the map.

    Returns:
        Whether the present place was recognised as that of an earlier visit.
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
            continue  # By position the result is the same for all visits to a place.
        stood_in.add(other.id)
        map_to_graph = network.map_to_graph if by_position else network.visit_transforms[visit]
        guess = compose(map_to_graph, other.frame)
        config = network.config.match
        if by_position or network.config.expects_drift:
            config = replace(config, max_shift=min(config.max_shift, drift))
        match = _match(network, seen, other, guess, pose, config)
        if by_position and match.matches == 0:
            continue  # It stands within many places: a mismatch with one is not worth an event.
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


def _match(
    network: PlaceNetwork,
    seen: Segments,
    other: LearnedPlace,
    guess: Pose,
    pose: Pose,
    config: MatchConfig,
) -> LineMatch:
    """Match what is seen with another place (algorithm 6).

    The thesis stops at the first alignment of more than four surfaces on both sides of the robot
    (lines 11 to 13). Rooms look alike, and such an alignment may be a chance one. So ours is the
    alignment of most surfaces, and its sides are tested afterwards (`has_structure`).
    """
    if network.config.takes_first_match:  # Alg. 6, lines 11 to 13
        enough = network.config.min_matches
        return match_first(seen, other.surfaces, guess, pose, config, enough)
    return match_lines(seen, other.surfaces, guess, pose, config)


def _candidates(
    network: PlaceNetwork,
    reobserved: Int32[np.ndarray, "visits"],
    gates: Int32[np.ndarray, "visits"],
) -> list[int]:
    """Return the visits that are candidates, those with the most re-observed surfaces first.

    Visits to one place without re-observed surfaces differ only in the map's drift since, so only
    the last of them is returned.
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
    """Return whether the present place is the other one, by the evidence if it was weighed."""
    config = network.config
    if evidence is not None:
        return evidence.probability >= config.min_probability
    least = config.min_share_here if by_position else config.min_share
    return match.share >= least and _is_confirmed(network, match, place, pose)


def _is_confirmed(network: PlaceNetwork, match: LineMatch, place: LearnedPlace, pose: Pose) -> bool:
    """Return whether algorithm 6 accepts the match and the robot would stand within the place.

    The second condition is ours. A place's description also holds what is seen through its exits,
    so without it the robot may be in the next place. Algorithm 6 asks for the first alone.
    """
    config = network.config
    return (
        has_structure(match, config)
        and match.share >= config.min_share
        and (not config.must_stand_within or place.holds(relative(match.pose, pose)[:2]))
    )


def has_structure(match: LineMatch, config: PlacesConfig) -> bool:
    """Return whether more than 4 surfaces match, on both sides of the robot (Alg. 6, line 11)."""
    return match.matches > config.min_matches and min(match.left, match.right) > 0


def _aligned(
    network: PlaceNetwork,
    believed: Pose,
    found: LineMatch,
    seen: Segments,
    other: LearnedPlace,
    robot: Pose,
) -> Pose:
    """Return the pose of a recognised place's frame: the believed one if it explains as much.

    Algorithm 8, line 13 lays the place where it was found. Ours differs: an alignment by few
    surfaces is accurate to about 40 cm, and the map is often better. So the pose is corrected only
    if at least two surfaces fewer match without the correction.
    """
    if not network.config.keeps_believed_pose:
        return found.pose
    near = replace(
        network.config.match, max_shift=network.config.tolerance, max_turn=np.radians(10.0)
    )
    match = match_lines(seen, other.surfaces, believed, robot, near)
    return believed if match.matches >= found.matches - 1 else found.pose


def candidate_gates(network: PlaceNetwork, pose: Pose) -> Int32[np.ndarray, "visits"]:
    """Return each visit's gate: with more re-observed surfaces than this it becomes a candidate.

    Surfaces of a place that an exit joins to the present one are seen through that exit: such a
    place is never a candidate, in `albot1-thesis` neither (section 4.1.2 does not say so). The rest
    is ours, and needs no re-observed surface at all:

    - a place that was a candidate just before the robot crossed an exit into a new place
      (SEEN_THROUGH_EXIT), because what was observed of it there is no longer in the map,
    - a place in which a robot that has just entered a new place believes to stand (STANDS_WITHIN),
    - all places if the robot was carried away, because it may be anywhere.

    Args:
        network: The network of places.
        pose: The robot's pose in the map.
    """
    gates = np.full(len(network.visits), NEVER, np.int32)
    if network.lost_since:
        gates[1:] = SEEN_THROUGH_EXIT
        return gates
    joined = {network.current, *(door.leads_to for door in network.here.exits)}
    by_place = {key: gate_of(place, network.config) for key, place in network.places.items()}
    by_place |= dict.fromkeys(_places_around(network, pose), STANDS_WITHIN)
    if network.config.candidates_seen_through_exits:
        by_place |= dict.fromkeys(network.log.seen_through_exit(), SEEN_THROUGH_EXIT)
    by_place |= dict.fromkeys(joined, NEVER)
    gates[1:-1] = [by_place[place] for place in network.visits[1:-1]]
    return gates


def counting_visits(network: PlaceNetwork) -> Int32[np.ndarray, "visits"]:
    """Return, for each visit, the visit for which its re-observed surfaces count.

    That is the first visit to its place with `counts_by_place`, as in section 4.1.2; otherwise the
    visit itself.
    """
    visits = network.visits
    if not network.config.counts_by_place:
        return np.arange(len(visits), dtype=np.int32)
    return np.array([0, *(visits.index(place, 1) for place in visits[1:])], np.int32)


def gate_of(place: LearnedPlace, config: PlacesConfig) -> int:
    """Return the gate of visits to a place: the thesis's n, which grows with it (section 4.1.2)."""
    share = round(config.reobserved_share * len(place.surfaces))
    return min(max(share, config.min_reobserved), config.max_reobserved)


def _places_around(network: PlaceNetwork, pose: Pose) -> list[int]:
    """Return the places around the believed position of a robot that has just entered a new one.

    A place is around the position if the bounding box of its surfaces, along the axes of its frame,
    holds it. A robot that is farther in than DOORSTEP would have recognised what it has seen.
    """
    if network.is_familiar or not network.config.candidates_by_position:
        return []
    if np.hypot(*relative(network.frame, pose)[:2]) > DOORSTEP:
        return []
    here = relative(network.map_to_graph, pose)
    return [key for key, place in network.places.items() if place.surrounds(*here[:2].tolist())]
