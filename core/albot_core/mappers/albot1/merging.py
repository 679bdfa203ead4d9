"""Making two places one, and all that follows from it (algorithms 5 and 7, line 13)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from albot_core.geometry.poses import compose, inverse, transform_points, transform_segments
from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.places import Passage, Site, middle
from albot_core.mappers.albot1.record import Event, Happening

if TYPE_CHECKING:
    from albot_core.mappers.albot1.network import PlaceNetwork


def merge(network: PlaceNetwork, step: int, kept: Site, gone: Site, pose: Pose) -> None:
    """Make two places one; `pose` is where the frame of the one gone lies in the other's.

    An exit that both have leads to one place: if they have it lead to two, these are
    one as well (line 13).
    """
    kept.describe(transform_segments(pose, gone.surfaces), network.config)
    first = len(kept.passages)
    for passage in gone.passages:
        passage.line = transform_segments(pose, passage.line[None])[0]
        kept.passages.append(passage)
    for site in network.sites.values():
        for passage in site.passages:
            if passage.leads_to == gone.id:
                passage.leads_to, passage.exit_there = kept.id, passage.exit_there + first
    _forget(network, gone, kept, pose)
    while kept.id in network.sites and _unite_exits(network, step, kept):
        pass


def _forget(network: PlaceNetwork, gone: Site, kept: Site, pose: Pose) -> None:
    """Nothing speaks of a place any more but as of the one that it is."""
    del network.sites[gone.id]
    # In a visit to the one, the other's frame lay where it does from here.
    moved = compose(compose(gone.frame, inverse(pose)), inverse(kept.frame))
    network.breadcrumbs.move(network.breadcrumbs.places == gone.id, inverse(moved), kept.id)
    for visit, place in enumerate(network.visits):
        if place == gone.id:
            network.visits[visit] = kept.id
            network.displacements[visit] = compose(network.displacements[visit], moved)
    network.current = kept.id if network.current == gone.id else network.current


def _unite_exits(network: PlaceNetwork, step: int, site: Site) -> bool:
    """Make two exits one that are in one place; false where all are apart."""
    for later, passage in enumerate(site.passages):
        earlier = site.passage_at(passage.line, later)
        if earlier is None:
            continue
        mine = site.passages[earlier]
        if mine.leads_to == passage.leads_to:
            _drop(network, network.sites[passage.leads_to], passage.exit_there)
            _drop(network, site, later)
            return True
        if not _are_joined(network, mine.leads_to, passage.leads_to):
            _follow_up(network, step, mine, passage)
            return True
    return False


def _drop(network: PlaceNetwork, site: Site, door: int) -> None:
    """Take an exit out of a place's list; those behind it move up, and are known so."""
    del site.passages[door]
    for moved in site.passages[door:]:
        network.sites[moved.leads_to].passages[moved.exit_there].exit_there -= 1


def _follow_up(network: PlaceNetwork, step: int, mine: Passage, theirs: Passage) -> None:
    """Two exits found to be one: what they lead to is one place."""
    first, second = sorted((mine, theirs), key=lambda passage: passage.leads_to)
    kept, gone = network.sites[first.leads_to], network.sites[second.leads_to]
    turn = gone.frame[2] - kept.frame[2]
    pose = np.array([0.0, 0.0, turn])
    there = transform_points(pose, middle(gone.passages[second.exit_there].line))
    pose[:2] = middle(kept.passages[first.exit_there].line) - there
    followed = Event(step=step, what=Happening.FOLLOWED, place=gone.id, other=kept.id)
    network.record.note(followed)
    if gone.id == network.current:
        network.displacement = compose(compose(network.frame, inverse(pose)), inverse(kept.frame))
    merge(network, step, kept, gone, pose)


def _are_joined(network: PlaceNetwork, one: int, other: int) -> bool:
    """Whether an exit leads from the one place to the other."""
    return any(passage.leads_to == other for passage in network.sites[one].passages)
