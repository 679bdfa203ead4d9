"""Which earlier visits a robot may suspect that it is on again (algorithm 6; section 4.1.2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.memory import NEVER
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.places import Site
from albot_core.mappers.albot1.record import AROUND, GLIMPSED

DOORSTEP = 5.0
"""A robot farther from where it entered a place has come in some time ago (m)."""


def suspicions(network: PlaceNetwork, pose: Pose) -> Int32[np.ndarray, "visits"]:
    """More than how many surfaces of each visit must be met again to arouse suspicion.

    What is met of places that an exit joins to the present one is seen through that exit,
    and they are not the same place. The rest is ours: a place suspected on this side of the exit
    just crossed is suspected beyond it (GLIMPSED), for what was met of it there is the map's no
    more; and so are places within which a robot that has just come into a new one believes to
    stand (AROUND). One that has lost its way may be anywhere.

    Args:
        network: What it knows of places.
        pose: Where it is in the map.
    """
    needed = np.full(len(network.visits), NEVER, np.int32)
    if network.lost_since:
        needed[1:] = GLIMPSED
        return needed
    joined = {network.current, *(passage.leads_to for passage in network.here.passages)}
    by_place = {key: surfaces_needed(site, network.config) for key, site in network.sites.items()}
    by_place |= dict.fromkeys(_places_around(network, pose), AROUND)
    by_place |= dict.fromkeys(network.record.glimpsed(), GLIMPSED)
    by_place |= dict.fromkeys(joined, NEVER)
    needed[1:-1] = [by_place[place] for place in network.visits[1:-1]]
    return needed


def surfaces_needed(site: Site, config: PlacesConfig) -> int:
    """More than how many surfaces of a place must be met again, if nothing else speaks for it.

    The thesis says no more than that they are more for a larger place.
    """
    share = round(config.suspicion_share * len(site.surfaces))
    return min(max(share, config.fewest_met), config.most_met)


def _places_around(network: PlaceNetwork, pose: Pose) -> list[int]:
    """The places within whose surfaces a robot believes to stand that has just entered a new one.

    Within the box, turned as the place's frame, that holds them. One that has come farther in
    than DOORSTEP would have recognised what it has seen.
    """
    if network.is_familiar or not network.config.by_position:
        return []
    if np.hypot(*relative(network.frame, pose)[:2]) > DOORSTEP:
        return []
    here = relative(network.displacement, pose)
    return [key for key, site in network.sites.items() if site.surrounds(*here[:2].tolist())]
