"""Recognising places that are visited again (algorithms 6 and 8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int32

from albot_core.geometry.poses import compose, inverse, relative
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.places import Site
from albot_core.mappers.albot1.record import AROUND, Happening
from albot_core.mappers.albot1.suspicion import surfaces_needed
from albot_core.matching.lines import LineMatch, match_lines


def recognize_place(
    network: PlaceNetwork, step: int, met: Int32[np.ndarray, "visits 2"], seen: Segments, pose: Pose
) -> bool:
    """Enough surfaces of earlier visits were met again (algorithms 6 and 8).

    Args:
        network: What it knows of places.
        step: The view at which they were.
        met: How many surfaces of each visit were met again in the present one, and more than
            how many arouse suspicion (see `suspicions`).
        seen: The surfaces of the map that were seen in the present visit (m).
        pose: Where the robot is in the map.

    Returns:
        Whether the present place was found to be that of an earlier visit.
    """
    network.looked_from = pose.copy()
    counts, needed = met.T
    stood_in: set[int] = set()
    for visit in _suspects(network, counts, needed):
        other, least = network.sites[network.visits[visit]], int(needed[visit])
        if least == AROUND and counts[visit] > surfaces_needed(other, network.config):
            least = surfaces_needed(other, network.config)
        by_position = least == AROUND
        if by_position and other.id in stood_in:
            continue  # Where it stands now is the same for all visits.
        stood_in.add(other.id)
        displacement = network.displacement if by_position else network.displacements[visit]
        guess = compose(displacement, other.frame)
        match = network.config.match_here if by_position else network.config.match
        likeness = match_lines(seen, other.surfaces, guess, pose, match)
        if by_position and likeness.matches == 0:
            continue  # It stands within many: that it stands in none of them is not worth telling.
        accepted = _is_confirmed(network, likeness, other, pose) and (
            not by_position or likeness.share >= network.config.share_here
        )
        what = Happening.RECOGNIZED if accepted else Happening.REFUSED
        why = {"met": int(counts[visit]), "needed": least}
        network.record.explain(step, what, network.current, other.id, likeness, **why)
        if accepted:
            network.identify(step, other, _settled(network, guess, likeness, seen, other, pose))
            return True
    return False


def find(network: PlaceNetwork, step: int, seen: Segments, pose: Pose) -> Pose | None:
    """Look for the present place among all that are known, wherever they may be.

    Returns:
        How the map since the loss must be moved to join on to what was known before;
        None where no place is recognised.
    """
    network.looked_from = pose.copy()
    first = network.visits[network.lost_since]
    known = [site for site in network.sites.values() if site.id < first]
    anywhere = replace(network.config.match, max_shift=np.inf, max_turn=np.pi)
    found = [
        (site, match_lines(seen, site.surfaces, network.frame, pose, anywhere)) for site in known
    ]
    confirmed = [
        (site, likeness) for site, likeness in found if _is_found(network, likeness, site, pose)
    ]
    if not confirmed:
        return None
    site, likeness = max(confirmed, key=lambda pair: (pair[1].matches, -pair[0].id))
    network.record.explain(step, Happening.FOUND, network.current, site.id, likeness)
    learned = network.displacements[network.visits.index(site.id)]
    motion = compose(compose(learned, site.frame), inverse(likeness.pose))
    for strange in network.sites.values():
        if strange.id >= first:
            frame = compose(motion, compose(network.displacement, strange.frame))
            strange.frame = relative(learned, frame)
    back = compose(relative(learned, motion), network.displacement)
    network.breadcrumbs.move(network.breadcrumbs.places >= first, back, None)
    network.displacement, network.lost_since = learned, 0
    network.identify(step, site, compose(motion, likeness.pose))
    return motion


def _suspects(
    network: PlaceNetwork, met: Int32[np.ndarray, "visits"], needed: Int32[np.ndarray, "visits"]
) -> list[int]:
    """The visits suspected, those of which most was met first.

    Visits to one place of which nothing was met differ in nothing but the map's drift since:
    the last of them speaks for all.
    """
    last = {place: visit for visit, place in enumerate(network.visits[:-1])}
    suspects = np.flatnonzero(met > needed)
    ordered = suspects[np.argsort(-met[suspects], kind="stable")].tolist()
    return [v for v in ordered if met[v] > 0 or last[network.visits[v]] == v]


def _is_confirmed(network: PlaceNetwork, likeness: LineMatch, site: Site, pose: Pose) -> bool:
    """Algorithm 6, line 11: more than 4 surfaces match, on both sides of the robot.

    A place's description holds what is seen through its exits. So we ask as well that
    the robot would stand within the place: otherwise it may be next door.
    """
    config = network.config
    return site.holds(relative(likeness.pose, pose)[:2]) and (
        likeness.matches > config.fewest_matches
        and min(likeness.left, likeness.right) > 0
        and likeness.share >= config.least_share
    )


def _is_found(network: PlaceNetwork, likeness: LineMatch, site: Site, pose: Pose) -> bool:
    """Whether a robot that may be anywhere knows the place again. This is ours."""
    enough = likeness.matches >= network.config.fewest_found
    return enough and _is_confirmed(network, likeness, site, pose)


def _settled(
    network: PlaceNetwork,
    believed: Pose,
    found: LineMatch,
    seen: Segments,
    other: Site,
    robot: Pose,
) -> Pose:
    """Where a recognised place's frame lies: where it was believed to, if that will do.

    An alignment by few surfaces is good to some 40 cm, the map is often better: it is
    corrected only where fewer surfaces are the same without.
    """
    near = replace(
        network.config.match, max_shift=network.config.agreement, max_turn=np.radians(10.0)
    )
    likeness = match_lines(seen, other.surfaces, believed, robot, near)
    return believed if likeness.matches >= found.matches - 1 else found.pose
