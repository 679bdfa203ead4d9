"""Graph SLAM: keyframes, the relative poses measured between them, loop closures, optimisation.

G. Grisetti, R. Kümmerle, C. Stachniss and W. Burgard, A tutorial on graph-based SLAM, IEEE
Intelligent Transportation Systems Magazine 2(4), 2010; the thesis reviews it in section 2.2.3, in
the four steps of `update`. The search for loop closures in a window around an earlier part of the
path follows W. Hess et al., Real-time loop closure in 2D LIDAR SLAM, ICRA 2016; the width of the
window follows from the graph's uncertainty (E. Olson, RAS 57, 2009).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int32
from scipy.special import chdtrc

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_points
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, PlaceMatches, WayHome
from albot_core.mappers.schema import Arrays, Field, Pack, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.graph_slam_config import GraphSlamConfig
from albot_core.mappers.slam.grid import LogOddsGrid
from albot_core.mappers.slam.laser_state import check_laser, laser_numbers, laser_of
from albot_core.mappers.slam.local_map import LocalMap, Match, ScanPoints, scan_points
from albot_core.mappers.slam.pose_graph import PoseGraph, invert_symmetric
from albot_core.mappers.slam.way_home import Ground, RouteKeeper
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import (
    MapSnapshot,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    TrajectoryLayer,
)
from albot_core.matching.correlation import Window, correlate_above
from albot_core.matching.likelihood_field import LikelihoodField
from albot_core.matching.refinement import refine
from albot_core.sensing.reading import LaserScan, Reading

_RESUMED = (0.1, 0.1, math.radians(2.0))
"""Standard deviations of the pose at which a map is resumed (m, m, rad)."""


class Keyframe(NamedTuple):
    """A scan that has a node in the graph."""

    scan: LaserScan
    """The scan."""
    points: ScanPoints
    """The points of the scan that are matched."""
    reading: int
    """Index of its reading."""


class Closure(NamedTuple):
    """A loop that was closed from the latest keyframe."""

    keyframe: int
    """Index of the earlier keyframe."""
    pose: Pose
    """Where the match puts the robot (map)."""
    distance: float
    """Distance of the robot there from the earlier keyframe (m)."""
    response: float
    """Mean likelihood of the points at that pose, from 0 to 1."""
    probability: float
    """Probability that a true closure is at least this far from the estimate: chi-square test."""


def _check_firsts(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless keyframes begin with the first reading."""
    for name in ("readings.followed", "keyframes.reading"):
        refuse_unless(not state[name][:1].any(), name, "numbers that grow from 0")


class GraphSlam(StoredMapper):
    """The mapper graph SLAM; it corrects earlier poses and knows a way home.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: GraphSlamConfig
    SCHEMA = Schema(
        Field("pose", "3"),
        Pack(
            "counts",
            int,
            Field("version", least=0),
            Field("waiting", least=0),
            Field("is_localised", "", bool),
            Field("beams"),
            at=None,
        ),
        Field("laser", "6", at=None),
        Field("readings.offset", "readings 3", at="_offsets"),
        Field("readings.followed", "readings", int, least=0, below="keyframes", rising=True),
        Field("keyframes.ranges", "keyframes beams", at=None, least=0, finite=False),
        Field(
            "keyframes.reading", "keyframes", int, at=None, least=0, below="readings", rising=True
        ),
        Field("matches.keyframe", "matches", int, at="_matched", least=0, below="keyframes"),
        Field("matches.shares", "matches 3", at="_shares", least=0, most=1),
        parts=("graph", "_local"),
        rules=(_check_firsts, check_laser),
    )

    def __init__(self, config: GraphSlamConfig | None = None, name: str = "graph-slam") -> None:
        config = config or GraphSlamConfig()
        self._local, self._route = LocalMap(config.matching), RouteKeeper(config.way_home)
        self._chain = LikelihoodField(config.closures.field)
        super().__init__(config, name)

    @property
    def estimate(self) -> Estimate:
        """The robot's pose; also the reading that it matches, if a loop was just closed there."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            localised=self._is_localised,
            matched_reading=self._keyframes[self._matched[0]].reading if self._matched else None,
            updates=len(self._keyframes),
            map_version=self._version,
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._local.reset()
        self._route.forget()
        self.graph = PoseGraph(self.config.cauchy, self.config.dcs)
        self._keyframes: list[Keyframe] = []
        self._pose = np.zeros(3)
        self._offsets: list[Pose] = []  # Of each reading: its pose in its keyframe's frame.
        self._followed: list[int] = []  # Of each reading: the index of its keyframe.
        self._version = self._waiting = 0
        self._matched: list[int] = []  # The keyframes at the latest one's place.
        self._shares: list[Any] = []  # Of each: response, probability and ambiguity.
        self._is_localised, self._is_surprised = True, False
        self._drawn: tuple[int, int, LogOddsGrid] | None = None
        self._optimum: tuple[tuple[int, int, int], Poses] | None = None

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan became a keyframe.

        Raises:
            InputError: The reading lacks a laser scan, or its laser differs from earlier ones.
        """
        laser = reading.required_laser(self._name)
        if self._keyframes and laser.geometry != self._keyframes[0].scan.geometry:
            raise InputError("Reading.laser", "the same laser at each reading", "another one")
        points = scan_points(laser, self.config.matching)
        match: Match | None = None
        is_kept = True
        if self._keyframes:
            match = self._local.match(points, compose(self._pose, reading.motion))
            self._pose, self._is_localised = match.pose, match.is_good
            is_kept = self._local.is_due(match.pose)
        if is_kept:
            keyframe = Keyframe(laser, points, len(self._offsets))
            self._add_node(keyframe, match)  # Steps 1 and 2.
            self._local.keep(self._pose, points.surface)
            self._match_places(self._close_loops())  # Step 3.
            if self._is_surprised or self._waiting >= self._most_waiting:
                self._optimise()  # Step 4.
        self._followed.append(len(self._keyframes) - 1)
        self._offsets.append(relative(self.graph.poses[-1], self._pose))
        return is_kept

    def _add_node(self, keyframe: Keyframe, match: Match | None) -> None:
        """Add a keyframe, and the edge from the previous one: the match, or else the odometry."""
        graph, number = self.graph, len(self._keyframes)
        self._keyframes.append(keyframe)
        graph.add_pose(self._pose)
        self._version += 1
        if match is None:
            return
        slip, turn = self._local.errors.deviations
        information = np.diag((1.0 / slip**2, 1.0 / slip**2, 1.0 / turn**2))
        if match.is_good:
            information = self._edge_information(match.information + information, self._pose)
        motion = relative(graph.poses[-2], self._pose)
        graph.add(number - 1, number, motion, information, closes=False)

    def resume(self, pose: Pose, scan: LaserScan) -> None:
        """Continue at a pose on the map; the next reading's motion begins there.

        The scan becomes a keyframe. Its edge from the previous one, which was taken elsewhere, is
        the relative pose on the map, known as well as localisation knows it. Loops are closed
        between it and the keyframes nearby.

        Raises:
            InputError: The laser differs from that of the map.
        """
        if self._keyframes and scan.geometry != self._keyframes[0].scan.geometry:
            raise InputError("Reading.laser", "the laser with which the map was made", "another")
        points = scan_points(scan, self.config.matching)
        self._pose, self._is_localised = pose.copy(), True
        self._keyframes.append(Keyframe(scan, points, len(self._offsets)))
        self.graph.add_pose(self._pose)
        last = len(self._keyframes) - 1
        if last:
            information = np.diag(1.0 / np.array(_RESUMED) ** 2)
            motion = relative(self.graph.poses[-2], self._pose)
            self.graph.add(last - 1, last, motion, information, closes=False)
        self._local.keep(self._pose, points.surface)
        self._followed.append(last)
        self._offsets.append(np.zeros(3))
        self._match_places(self._close_loops())
        self._version += 1

    def _edge_information(
        self, information: Float64[np.ndarray, "3 3"], pose: Pose
    ) -> Float64[np.ndarray, "3 3"]:
        """Rotate information from the map's axes to the robot's, and limit it by the floors."""
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        turned = np.array(((cos, -sin, 0.0), (sin, cos, 0.0), (0.0, 0.0, 1.0)))
        config = self.config
        floors = np.diag((config.floor, config.floor, config.turn_floor)) ** 2
        own = turned.T @ information @ turned + 1e-6 * np.eye(3)
        return invert_symmetric(invert_symmetric(own) + floors)

    def _close_loops(self) -> list[Closure]:
        """Compare the latest keyframe with earlier ones nearby; add an edge for each match.

        Returns:
            The loops that were closed, with the nearest keyframe by the estimate first.
        """
        closed: list[Closure] = []
        config, graph = self.config.closures, self.graph
        latest = len(self._keyframes) - 1
        last = latest - config.behind
        if last < 0:
            return closed
        far, last_edges = graph.spreads(latest)
        away = np.hypot(*(graph.poses[: last + 1] - graph.poses[latest])[:, :2].T)
        spread = np.minimum(np.sqrt(far[: last + 1]), config.most_reach / config.deviations)
        distance = away - config.deviations * spread
        open_ones = distance < config.near
        scan: ScanPoints | None = None
        for _ in range(config.tries):
            if not open_ones.any():
                break
            # Of the keyframes that may be near, the one that is nearest by the current estimate.
            other = int(np.argmin(np.where(open_ones, away, np.inf)))
            low, high = max(0, other - config.chain), min(last, other + config.chain)
            open_ones[max(0, low - config.chain) : high + config.chain + 1] = False
            scan = self._latest_together() if scan is None else scan
            closure = self._compare(latest, other, range(low, high + 1), scan, last_edges)
            closed += [] if closure is None else [closure]
        return closed

    def _match_places(self, closed: list[Closure]) -> None:
        """Remember the keyframes of closures at whose place the robot is, and how sure that is."""
        near = self.config.closures.same_place
        here = [closure for closure in closed if closure.distance <= near]
        self._matched = [closure.keyframe for closure in here]
        self._shares = []
        for closure in here:
            rivals = (
                other.probability
                for other in closed
                if math.hypot(*(other.pose - closure.pose)[:2]) > near
            )
            self._shares.append((closure.response, closure.probability, max(rivals, default=0.0)))

    def place_matches(self, most: int) -> PlaceMatches:
        """Return the earlier keyframes at the latest one's place with which loops were closed.

        The score is the mean likelihood of the points at the earlier keyframe's surfaces. The
        probability is that of a chi-square test: that a true closure is at least this far from the
        estimate before it. The ambiguity is that of another closure that puts the robot elsewhere;
        by default (`ClosureConfig.tries`) no second part of the path is tried, and it is 0.
        """
        chosen = self._matched[:most]
        readings = [self._keyframes[number].reading for number in chosen]
        shares = np.reshape(self._shares[:most], (-1, 3))
        return np.column_stack((shares, self.graph.poses[chosen, :2], readings))

    def _latest_together(self) -> ScanPoints:
        """Return the points of the latest keyframes as one scan, in the frame of the last."""
        together = range(
            max(0, len(self._keyframes) - self.config.closures.together), len(self._keyframes)
        )
        points, normals = [], []
        for number in together:
            frame = relative(self.graph.poses[-1], self.graph.poses[number])
            points.append(transform_points(frame, self._keyframes[number].points.points))
            turn = np.array((0.0, 0.0, frame[2]))
            normals.append(transform_points(turn, self._keyframes[number].points.normals))
        return ScanPoints(np.concatenate(points), np.concatenate(normals), np.empty((0, 2)))

    def _compare(
        self,
        latest: int,
        other: int,
        chain: range,
        scan: ScanPoints,
        last_edges: Int32[np.ndarray, "keyframes"],
    ) -> Closure | None:
        """Match the latest keyframes with earlier ones; return the closure if an edge was added."""
        config, graph = self.config.closures, self.graph
        guess = graph.poses[latest].copy()
        self._chain.clear(guess[:2])
        for number in chain:
            self._chain.add(graph.poses[number], self._keyframes[number].points.surface)
        spread, turn = graph.deviations(latest, other, last_edges)
        window = Window(
            min(max(config.deviations * spread, config.least_reach), config.most_reach),
            min(max(config.deviations * turn, config.least_turn), config.most_turn),
            self.config.matching.heading_step,
        )
        prior = 0.5 / np.array((max(spread, 0.05), max(spread, 0.05), max(turn, 0.02))) ** 2
        share = min(window.reach / config.most_reach, 1.0)
        needed = config.response + share * (config.wide_response - config.response)
        least = config.unrefined * needed * len(scan.points)
        best = correlate_above(least, self._chain, scan.points, guess, window, prior)
        if best is None:
            return None
        found = refine(self._chain, scan.points, scan.normals, best.pose, guess, 0.0 * prior)
        if found.response < needed:
            return None
        correlated = self.config.matching.correlated * self.config.closures.together
        information = self._edge_information(found.information / correlated, found.pose)
        motion = relative(graph.poses[other], found.pose)
        graph.add(other, latest, motion, information, closes=True)
        self._waiting += 1
        off = relative(found.pose, guess)
        self._is_surprised |= bool(off @ information @ off > self.config.surprise**2)
        # The estimate's errors along x and y are taken to be equal.
        errors = np.diag((0.5 * spread**2, 0.5 * spread**2, turn**2))
        excess = off @ invert_symmetric(errors + invert_symmetric(information)) @ off
        return Closure(
            keyframe=other,
            pose=found.pose,
            distance=math.hypot(motion[0], motion[1]),
            response=min(float(found.response), 1.0),
            probability=float(chdtrc(3, excess)),
        )

    @property
    def _most_waiting(self) -> int:
        """Number of closures that may wait for the next optimisation."""
        share = self.config.waiting_share * self.graph.closures
        return max(self.config.most_waiting, int(share))

    def _optimise(self) -> None:
        """Optimise the poses of all keyframes, and move the robot with the last of them."""
        self.graph.poses = self.graph.optimum()
        self._pose = self.graph.poses[-1].copy()
        self._waiting, self._is_surprised = 0, False
        self._version += 1
        kept = min(len(self.graph.poses), self.config.matching.scans)
        self._local.move(self.graph.poses[-kept:])

    def _settled(self) -> Poses:
        """Return the keyframes' poses after all closures, including those that wait."""
        if not self._waiting:
            return self.graph.poses
        graph = self._version, len(self.graph.poses), len(self.graph.ends)
        if self._optimum is None or self._optimum[0] != graph:  # A snapshot asks several times.
            self._optimum = graph, self.graph.optimum()
        return self._optimum[1]

    def corrected_poses(self) -> Poses:
        """Return the robot's pose at every reading since the reset, as estimated now."""
        if not self._followed:
            return np.empty((0, 3))
        followed: Poses = self._settled()[self._followed]
        return compose(followed, np.array(self._offsets))

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are free in the map."""

        def ground() -> Ground:
            return self._grid().ground(self.graph.poses[:, :2])

        version = self._version, len(self.graph.poses), self.graph.closures
        return self._route.way_home(version, self._pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the grid of all keyframes, the pose graph, and the corrected trajectory."""
        poses = self._settled()
        nodes = tuple(
            PlaceNode(id=k, label=f"K{k + 1}", pose=pose, middle=pose[:2])
            for k, pose in enumerate(poses.copy())
        )
        edges = tuple(
            PlaceEdge(source=source, target=target, motion=motion.copy(), information=information)
            for (source, target), motion, information in zip(
                self.graph.ends, self.graph.motions, self.graph.information, strict=True
            )
        )
        home, current = (0, len(nodes) - 1) if nodes else (None, None)
        graph = PlaceGraph(nodes=nodes, edges=edges, home=home, current=current)
        way = TrajectoryLayer(poses=self.corrected_poses())
        return MapSnapshot(layers=(self._grid().layer(), graph, way))

    def _grid(self) -> LogOddsGrid:
        """Return the grid of all keyframes; only new ones are added if no pose was corrected."""
        closures, done, grid = self._drawn or (-1, 0, LogOddsGrid(self.config.grid))
        if closures != self.graph.closures:
            done, grid = 0, LogOddsGrid(self.config.grid)
        if done < len(self._keyframes):
            settled = self._settled()
            for keyframe, pose in zip(self._keyframes[done:], settled[done:], strict=True):
                grid.integrate(pose, keyframe.scan)
        self._drawn = self.graph.closures, len(self._keyframes), grid
        return grid

    def _stored(self) -> dict[str, Any]:
        scans = [keyframe.scan for keyframe in self._keyframes]
        laser, ranges = laser_numbers(scans)
        counts = self._version, self._waiting, self._is_localised, ranges.shape[1]
        return {
            "counts": counts,
            "laser": laser,
            "keyframes.ranges": ranges,
            "keyframes.reading": [keyframe.reading for keyframe in self._keyframes],
        }

    def _restored(self, state: Arrays) -> None:
        laser = laser_of(state["laser"], int(state["counts"][-1]))
        for ranges, reading in zip(
            state["keyframes.ranges"].copy(), state["keyframes.reading"].tolist(), strict=True
        ):
            scan = LaserScan(ranges=ranges, geometry=laser)
            self._keyframes.append(Keyframe(scan, scan_points(scan, self.config.matching), reading))
        self._version, self._waiting, localised, _ = state["counts"].tolist()
        self._is_localised = bool(localised)
