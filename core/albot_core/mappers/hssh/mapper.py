"""The Hybrid Spatial Semantic Hierarchy as a mapper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.hssh.belief import Belief
from albot_core.mappers.hssh.config import HsshConfig
from albot_core.mappers.hssh.events import CONTRADICTED, NEW, RECOGNISED, Event, EventLog
from albot_core.mappers.hssh.gateways import Ground, crossed, find_gateways
from albot_core.mappers.hssh.layers import place_graph
from albot_core.mappers.hssh.local_topology import (
    entered_by,
    is_back,
    is_place,
    is_settled,
    perceived,
)
from albot_core.mappers.hssh.map_tree import MapTree
from albot_core.mappers.hssh.perceptual_map import LocalPerceptualMap
from albot_core.mappers.hssh.region import Region, region_around
from albot_core.mappers.hssh.state import RULES, rows_of, tree_of
from albot_core.mappers.hssh.topological_map import TopologicalMap
from albot_core.mappers.hssh.visit import Visit
from albot_core.mappers.hssh.visits import Visits
from albot_core.mappers.mapper import Estimate, WayHome
from albot_core.mappers.schema import Arrays, Field, Pack, Schema
from albot_core.mappers.slam.local_map import LocalMap, scan_points
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserScan, Reading

_PATIENCE = 3
"""Number of searches without the gateway through which the robot came, after which another one is
taken for it."""


class Hssh(StoredMapper):
    """Local perceptual map, gateways, stars, and the tree of topological maps.

    It knows a way home (`RouteHome`), remembers places (`PlaceMemory`), and corrects its earlier
    poses (`CorrectedTrajectory`). What it believes is the preferred map of the tree.

    Args:
        config: All parameters.
        name: The name under which the mapper is registered.
    """

    config: HsshConfig
    SCHEMA = Schema(
        Field("pose", "3"),
        Field("poses", "readings 3"),
        Field("way", "", least=0),
        Field("searched", "", least=0),
        Pack(
            "counts",
            int,
            Field("updates", least=0, most="readings"),
            Field("version", least=0),
            Field("misses", least=0, most=_PATIENCE),
            Field("matched", least=-1, below="readings"),
            Field("is_localised", "", bool),
        ),
        Field("tree.visits", "maps known numbers", int, at=None, least=-1),
        Field("tree.counts", "2", int, at=None, least=0),
        parts=("_local", "_perceived", "_visits", "_log"),
        rules=RULES,
    )

    def __init__(self, config: HsshConfig | None = None, name: str = "hssh") -> None:
        config = config or HsshConfig()
        self._local = LocalMap(config.matching)
        self._perceived = LocalPerceptualMap(config.grid, config.half)
        self._visits, self._log = Visits(config), EventLog()
        super().__init__(config, name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._local.reset()
        self._perceived.clear()
        self._visits.clear()
        self._log.clear()
        self._pose = np.zeros(3)  # In the frame of the odometry, which scan matching corrects.
        self._poses: list[Pose] = []  # At each reading, in the frame of the odometry.
        self._way = self._searched = 0.0  # Distance driven, in all and until the latest search.
        self._updates = self._version = self._misses = 0
        self._matched = -1
        self._is_localised = True
        self._tree: MapTree | None = None  # Of all visits that have ended.
        self._belief = Belief(self._visits, None)

    # The readings.

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan was added to the local perceptual map.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        laser = reading.required_laser(self._name)
        is_first = not self._poses
        if not is_first:
            self._pose = compose(self._pose, reading.motion)
            x, y, _ = reading.motion.tolist()
            self._way += math.hypot(x, y)
        is_kept = is_first or self._local.is_due(self._pose)
        if is_kept:
            self._keep(laser, is_first)
        self._poses.append(self._pose)
        if is_first:
            self._visits.begin(self._nothing())
            self._belief = Belief(self._visits, None)
        elif self._has_left():
            self._search()
        if is_kept and (is_first or self._way - self._searched >= self.config.places.search):
            self._search()
        if is_kept:
            self._matched = self._belief.nearest_reading(self._poses, self.config.places.claim)
        return is_kept

    def _keep(self, laser: LaserScan, is_first: bool) -> None:
        """Match a scan with the latest ones, and add it to the local perceptual map.

        Scans in between only move the robot by its odometer, which is ours, for speed.
        """
        scan = scan_points(laser, self.config.matching)
        if not is_first:
            match = self._local.match(scan, self._pose)
            self._pose, self._is_localised = match.pose, match.is_good
        self._local.keep(self._pose, scan.surface)
        self._perceived.integrate(self._pose, laser)
        self._updates += 1
        self._version += 1

    def _nothing(self) -> Visit:
        """Return a visit that begins here, of which nothing is known yet."""
        return Visit(
            entered=len(self._poses) - 1,
            way=self._way,
            arrived=-1,
            left=-1,
            middle=self._pose[:2].copy(),
            gateways=np.empty((0, 4)),
            unknown=(0,),
            surface=np.empty((0, 2)),
            open_ground=np.empty((0, 2)),
        )

    # The local topology.

    def _has_left(self) -> bool:
        """End the visit if the robot has left its place through a gateway; return whether."""
        visit = self._visits.last
        if visit.left >= 0 or not len(visit.gateways):
            return False
        x, y, _ = self._pose.tolist()
        gateway = crossed(visit.gateways, x, y, self.config.places.beyond)
        if gateway < 0:
            return False
        self._visits.amend(visit._replace(left=gateway))
        self._misses = 0
        self._version += 1
        return True

    def _search(self) -> None:
        """Search the local perceptual map for gateways, and for the place around the robot."""
        self._searched = self._way
        self._perceived.scroll(self._pose)
        ground = self._perceived.ground(self._pose, self.config.gateways.island)
        narrows = find_gateways(ground, self.config.gateways)
        region = region_around(ground, narrows, self._pose[:2], self.config.gateways.narrowest)
        if region is None:
            return
        if self._visits.is_away:
            self._arrive(ground, region)
        else:
            self._look_again(ground, region)

    def _arrive(self, ground: Ground, region: Region) -> None:
        """Begin a visit if the region is a place with the gateway through which the robot came."""
        if not is_place(region, self._pose[:2], self.config):
            return
        last = self._visits.last
        arrived = self._entrance(region, last)
        if arrived < 0:
            return
        is_open = self._known < len(self._visits)
        if is_open and is_back(region, arrived, last, self.config.places.near):
            self._visits.amend(last._replace(left=-1))
            self._version += 1
            return
        self._end_visit()
        self._visits.begin(self._nothing())
        self._perceive(ground, region, arrived)

    def _entrance(self, region: Region, last: Visit) -> int:
        """Return the gateway through which the robot came into a region; -1 if it is not known.

        It is the one that the robot has crossed last since it left the last place; or, after some
        searches, the one nearest to where it left.
        """
        crossed_last = entered_by(region, np.array(self._poses[last.entered :])[:, :2])
        if crossed_last >= 0 or self._misses < _PATIENCE:
            self._misses += crossed_last < 0
            return crossed_last
        if not region.is_whole:
            return -1  # That gateway may not have been seen yet.
        left = last.middles[last.left]
        return int(np.argmin(np.hypot(*(region.middles - left).T)))

    def _look_again(self, ground: Ground, region: Region) -> None:
        """Replace what is known of the present place, if the region is that of the visit."""
        visit, near = self._visits.last, self.config.places.near
        if is_settled(visit, region, self._pose):
            return
        if visit.arrived < 0:
            self._perceive(ground, region, -1)
            return
        if not len(region.gateways):
            return
        away = np.hypot(*(region.middles[:, None] - visit.middles).transpose(2, 0, 1))
        if region.is_path(self.config.gateways):
            if not visit.unknown and not (len(away.T) == 2 and (away.min(axis=0) <= near).all()):
                return  # It is beside the place.
            # Its far end has come into view, and it is a piece of the path.
            self._visits.cancel()
            self._belief = Belief(self._visits, None if self._tree is None else self._tree.best)
            return
        nearest = int(np.argmin(away[:, visit.arrived]))
        if away[nearest, visit.arrived] > near and self._misses < _PATIENCE:
            self._misses += 1
            return
        self._perceive(ground, region, nearest)

    def _perceive(self, ground: Ground, region: Region, arrived: int) -> None:
        """Note what is known of the present place, and what the tree makes of it."""
        self._misses = 0
        visit = perceived(self._visits.last, ground, region, arrived, self.config.places)
        self._visits.amend(visit)
        self._preview()
        self._version += 1

    # The global topology.

    @property
    def _known(self) -> int:
        """Number of visits that the tree knows."""
        return 0 if self._tree is None else 1 + len(self._tree.travels)

    def _end_visit(self) -> None:
        """Extend the tree by the last visit, now that the robot has come to another place.

        A robot that turns round on its way has not left: that is no travel action.
        """
        number = len(self._visits) - 1
        if self._known > number:
            return
        believed = self._belief.best
        before = () if believed is None else believed.visits
        forgotten = 0
        agrees = True
        if self._tree is None:
            self._tree = MapTree(self._visits.star(0), self.config.tree)
        else:
            forgotten = self._tree.forgotten
            agrees = self._tree.travel(self._visits.travel(number), self._visits.judge)
            forgotten = self._tree.forgotten - forgotten
        best = self._tree.best
        here = best.here
        kind = NEW if best.firsts[here.place] == number else RECOGNISED
        self._log.add(
            Event(
                kind=kind if agrees else CONTRADICTED,
                reading=len(self._poses) - 1,
                place=here.place,
                gateways=len(self._visits[number].gateways),
                maps=len(self._tree.maps),
                minimal=len(self._tree.minimal),
                forgotten=forgotten,
                switched=int(before[:number] != best.visits[:number]),
            )
        )

    def _preview(self) -> None:
        """Believe what the tree would hold if the present visit ended now."""
        number = len(self._visits) - 1
        if self._tree is None:
            self._belief = Belief(self._visits, None)
            return
        travel = self._visits.travel(number)
        # All maps are extended at the end of the visit only, for speed.
        maps = self._tree.preview(travel, self._visits.judge, self._tree.minimal[:1])
        best = maps[0] if maps else self._tree.best.repaired(travel)
        self._belief = Belief(self._visits, best)

    # What is believed.

    @property
    def believed_map(self) -> TopologicalMap:
        """The preferred map, with the present visit as it is perceived so far."""
        return self._belief.map

    @property
    def estimate(self) -> Estimate:
        """The robot's pose in the metric layout of the preferred map; home is where it started."""
        return Estimate(
            pose=compose(self._belief.frame, self._pose),
            home=np.zeros(3),
            localised=self._is_localised,
            place=self._belief.places[-1] if self._poses else None,
            matched_reading=None if self._matched < 0 else self._matched,
            updates=self._updates,
            map_version=self._version,
        )

    @property
    def tree(self) -> MapTree | None:
        """The tree of the maps of all visits that have ended; None before the first has."""
        return self._tree

    @property
    def visits(self) -> Visits:
        """The visits so far; later updates change them."""
        return self._visits

    @property
    def events(self) -> tuple[Event, ...]:
        """What the tree made of each visit that has ended, in order."""
        return self._log.events

    def place_at(self, reading: int) -> int:
        """Return the id of the place where a reading was taken, or that was left before it."""
        return self._belief.places[int(self._belief.visit_of_readings(len(self._poses))[reading])]

    def corrected_poses(self) -> Poses:
        """Return the pose at every reading since the reset, as estimated now, (readings, 3)."""
        if not self._poses:
            return np.empty((0, 3))
        frames = self._belief.frames[self._belief.visit_of_readings(len(self._poses))]
        return compose(frames, np.array(self._poses))

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over gateways and paths: the next gateway, and its length.

        In the place of home it leads straight there.
        """
        return self._belief.way_home(self.estimate.pose[:2], self.config.ahead)

    def snapshot(self) -> MapSnapshot:
        """Return the local perceptual map, and the places and paths of the preferred map."""
        leaf = self.believed_map if self._poses else None
        graph = place_graph(leaf, self._visits, self._belief.frames)
        return MapSnapshot(layers=(self._perceived.layer(self._belief.frame), graph))

    def _sizes(self) -> dict[str, Any]:
        return {"config": self.config}

    def _stored(self) -> dict[str, Any]:
        maps: Sequence[TopologicalMap] = [] if self._tree is None else self._tree.maps
        tree = self._tree
        return {
            "tree.visits": rows_of(maps),
            "tree.counts": (0, 0) if tree is None else (tree.forgotten, tree.contradictions),
        }

    def _restored(self, state: Arrays) -> None:
        self._tree = tree_of(state, self.config)
        if not self._poses:
            return
        if self._known == len(self._visits):
            self._belief = Belief(self._visits, None if self._tree is None else self._tree.best)
        else:
            self._preview()
