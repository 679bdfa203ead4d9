"""The gap explorer: drives to the nearest visible gap with new ground behind it.

After the exploration of Yeap et al., Autonomous Robot Mapping by Landmark Association
(2015): the robot moves towards a near gap that is wide enough for it. It remembers gaps and
open ground that it passes, and returns to them when nothing new is in view.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.pose_kernels import bearings_of
from albot_core.geometry.types import Points, Pose
from albot_core.planning.explorer import Explorer
from albot_core.planning.occupancy_grid import OccupancyGrid, ShortestPaths
from albot_core.planning.percept import Percept
from albot_core.planning.steering import SteeringConfig
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields


@dataclass(frozen=True, kw_only=True)
class GapExplorerConfig:
    """Parameters of the gap explorer."""

    gap_spare: float = 0.1
    """Least width of a gap beyond the robot's own (m); it does not fit through narrower ones."""
    reach: float = 6.5
    """Largest distance of gaps and ground that are considered (m)."""
    clearance: float = 0.15
    """Least distance of the robot's body at a goal from obstacles (m)."""
    turn_cost: float = 0.7
    """Cost of a turn towards the goal (m of path per radian)."""
    gain: float = 0.0
    """Gain of a goal with completely new ground around it (m of path). Above 0, a whole room is
    preferred to a smaller area nearby."""
    random_cost: float = 0.5
    """Largest random cost (m of path), which makes tours differ."""
    steering: SteeringConfig = field(default_factory=SteeringConfig)
    """The steering parameters."""
    min_new_share: float = 0.75
    """Least share of new ground around a goal. When no such goal is left, any new ground is
    enough."""
    coverage_range: float = 2.0
    """Largest distance at which visible ground counts as covered (m)."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "gap_spare", "reach", "clearance", "coverage_range", "min_new_share"
        )
        check_fields(self, NOT_NEGATIVE, "turn_cost", "gain", "random_cost")

    @property
    def gap_width(self) -> float:
        """Least width of a gap (m)."""
        return 2 * self.steering.robot.radius + self.gap_spare

    @property
    def goal_radius(self) -> float:
        """Least distance of a goal from obstacles (m)."""
        return self.steering.robot.radius + self.clearance


class GapExplorer(Explorer):
    """Drives to the nearest gap, again and again, and back to gaps that it has passed.

    Args:
        config: The parameters.
    """

    _LOOK_EVERY = 3
    """Steps between two searches for candidate goals."""
    _SURROUNDINGS = 1.5
    """Half the side (m) of the square around a goal in which new ground counts for `gain`."""
    _FAN = np.radians(6.0)
    """Angle between the beams that are searched for open ground (rad)."""

    def __init__(self, config: GapExplorerConfig = GapExplorerConfig()) -> None:
        super().__init__(config.coverage_range, config.steering)
        self._config = config

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state, and begin with a full turn to look around."""
        super().reset(rng)
        self._candidates = CandidateGoals()
        self._least = self._config.min_new_share

    def _observe(self, percept: Percept) -> None:
        """Integrate the scan into the grid, and update the candidate goals."""
        self._grid.integrate(percept)
        if self._steps % self._LOOK_EVERY == 0:
            self._add_gaps(percept)
            ground = self._open_ground(percept)
            self._candidates.add(ground, ground)
            self._candidates.drop_covered(self._grid, percept.pose, self._least)
            if self._goal is not None and not self._candidates.holds(self._goal):
                self._goal = None
        self._steps += 1

    def _add_gaps(self, percept: Percept) -> None:
        """Add the visible gaps as candidates, each with the ground behind it."""
        config = self._config
        gaps = find_gaps(percept.points, narrowest=config.gap_width, reach=config.reach)
        if gaps:
            centres = np.stack([gap.centre for gap in gaps])
            hidden = np.stack([gap.beyond(2 * config.goal_radius) for gap in gaps])
            centres, hidden = percept.to_map(centres), percept.to_map(hidden)
            new = self._is_new(hidden)
            self._candidates.add(centres[new], hidden[new])

    def _open_ground(self, percept: Percept) -> Float64[np.ndarray, "places 2"]:
        """Return visible, uncovered points on a fan of beams at which the robot fits.

        The points are in the map's frame (m).
        """
        config, laser = self._config, percept.laser
        distances = np.arange(1.0, config.reach, 1.0)
        beams = np.arange(0, laser.beams, max(1, round(self._FAN / laser.spacing)))
        free = percept.ranges[beams, None] - config.goal_radius > distances
        fan = (laser.directions[beams, None] * distances[:, None])[free]
        fan = fan[self._is_new(percept.to_map(fan))]
        apart = fan[:, None] - percept.points
        clear = (np.hypot(apart[..., 0], apart[..., 1]) > config.goal_radius).all(axis=1)
        return percept.to_map(fan[clear])

    def _is_new(self, ground: Points) -> Bool[np.ndarray, "places"]:
        """Return whether the ground at points (m, map frame) is new enough to be a goal."""
        left = self._grid.uncovered_share(ground)
        return np.asarray((left > 0) & (left >= self._least))

    def _give_up(self, goal: Float64[np.ndarray, "2"]) -> None:
        """Drop the candidates with a goal; do not add their ground again until `readmit`."""
        self._candidates.give_up(goal)

    def _plan(self, percept: Percept) -> None:
        """Search the path to the goal again; choose a new goal without a goal or a path."""
        grid = self._grid
        if self._goal is not None:
            self._route = grid.route(grid.shortest_paths(percept.pose, goal=self._goal), self._goal)
            if len(self._route):
                return
        paths = grid.shortest_paths(percept.pose)
        self._goal = self._choose(percept, paths)
        if self._goal is not None:
            self._route = grid.route(paths, self._goal)

    def _choose(self, percept: Percept, paths: ShortestPaths) -> Float64[np.ndarray, "2"] | None:
        """Return the candidate goal with the lowest total cost; None if none is left.

        Yeap et al. drive to the nearest gap. That the ground behind it can count too is our
        addition.
        """
        config, goals = self._config, self._candidates.goals
        lengths = np.array([self._grid.length(paths, goal) for goal in goals])
        if not np.isfinite(lengths).any():
            self._candidates.readmit()
            self._least = 0.0
            self._look_round.begin()
            return None
        turns = np.abs(bearings_of(percept.to_robot(goals)))
        random_costs = config.random_cost * self._rng.random(len(goals))
        gains = config.gain * self._grid.uncovered_share(
            self._candidates.ground, self._SURROUNDINGS
        )
        chosen = int((lengths + config.turn_cost * turns + random_costs - gains).argmin())
        self._stall.start(float(lengths[chosen]))
        return np.array(goals[chosen])


_SAME_SURFACE = 0.2
"""Largest distance (m) of a point on the same surface from the surface's line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Gap:
    """An opening between two edges, in the robot's frame."""

    centre: Float64[np.ndarray, "2"]
    """Midpoint between its two edges (m)."""
    outward: Float64[np.ndarray, "2"]
    """Unit vector across the opening, away from the robot."""
    width: float
    """Distance between its edges (m)."""

    def beyond(self, distance: float) -> Float64[np.ndarray, "2"]:
        """Return the point at a distance (m) behind the centre of the opening."""
        return np.asarray(self.centre + distance * self.outward)


def find_gaps(
    points: Float64[np.ndarray, "beams 2"], *, narrowest: float, reach: float
) -> list[Gap]:
    """Return the gaps in a scan, in the order of the beams.

    Where the range jumps between neighbouring beams, the nearer surface ends at an edge. The other
    edge of the gap is the point nearest to it on the farther side of the jump.

    Args:
        points: The beams' end points (m, robot's frame).
        narrowest: Gaps must be wider than this (m).
        reach: Largest distance of a gap's centre from the robot (m).
    """
    ranges = np.hypot(points[:, 0], points[:, 1])
    gaps = []
    for k in np.flatnonzero(np.abs(np.diff(ranges)) > narrowest).tolist():
        if _is_one_surface(points, k):
            continue
        if ranges[k] < ranges[k + 1]:
            edge, farther = points[k], points[k + 1 :]
        else:
            edge, farther = points[k + 1], points[: k + 1]
        across = np.hypot(farther[:, 0] - edge[0], farther[:, 1] - edge[1])
        nearest = int(across.argmin())
        other, width = farther[nearest], float(across[nearest])
        centre = (edge + other) / 2
        if width > narrowest and np.hypot(centre[0], centre[1]) <= reach:
            along = (other - edge) / max(width, 1e-9)
            outward = np.array((-along[1], along[0]))
            if (outward * centre).sum() < 0:
                outward = -outward
            gaps.append(Gap(centre=centre, outward=outward, width=width))
    return gaps


def _is_one_surface(points: Float64[np.ndarray, "beams 2"], k: int) -> bool:
    """Return whether beams k and k + 1 hit the same wall, whose range jumps at a grazing angle.

    They do if the line through the points on one side continues to the point on the other side.
    """
    runs_on = False
    if k >= 2:
        runs_on |= _off_line(points[k - 2], points[k], points[k + 1]) < _SAME_SURFACE
    if k + 3 < len(points):
        runs_on |= _off_line(points[k + 3], points[k + 1], points[k]) < _SAME_SURFACE
    return runs_on


def _off_line(
    start: Float64[np.ndarray, "2"], end: Float64[np.ndarray, "2"], point: Float64[np.ndarray, "2"]
) -> float:
    """Return the distance (m) of a point from the line through two others."""
    (dx, dy), (px, py) = end - start, point - end
    length = float(np.hypot(dx, dy))
    return abs(float(dx * py - dy * px)) / max(length, 1e-9)


class CandidateGoals:
    """Candidate goals with the uncovered ground behind each; kept until the ground is covered.

    Args:
        spacing: Least distance of new ground from ground kept or given up (m).
    """

    def __init__(self, spacing: float = 0.8) -> None:
        self._spacing = spacing
        self.goals: Float64[np.ndarray, "candidates 2"] = np.empty((0, 2))
        """The goals (m, map frame)."""
        self.ground: Float64[np.ndarray, "candidates 2"] = np.empty((0, 2))
        """The ground that each goal covers (m, map frame)."""
        self._given_up: Float64[np.ndarray, "places 2"] = np.empty((0, 2))

    def add(self, goals: Float64[np.ndarray, "n 2"], ground: Float64[np.ndarray, "n 2"]) -> None:
        """Add goals whose ground is far enough from ground kept or given up (m, map frame)."""
        for goal, spot in zip(goals, ground, strict=True):
            known = np.concatenate((self.ground, self._given_up)) - spot
            if not (np.hypot(known[:, 0], known[:, 1]) < self._spacing).any():
                self.goals = np.vstack((self.goals, goal))
                self.ground = np.vstack((self.ground, spot))

    def drop_covered(self, grid: OccupancyGrid, pose: Pose, least: float = 0.0) -> None:
        """Drop candidates whose ground is covered, or whose goal the robot has reached.

        Ground counts as covered if the uncovered share is below `least`.
        """
        here = np.hypot(*(self.goals - pose[:2]).T) < 0.3
        left = grid.uncovered_share(self.ground)
        self._keep((left > 0) & (left >= least) & ~here)

    def holds(self, goal: Float64[np.ndarray, "2"]) -> bool:
        """Return whether a goal is still among the candidates."""
        return bool((self.goals == goal).all(axis=1).any())

    def give_up(self, goal: Float64[np.ndarray, "2"]) -> None:
        """Drop the candidates with a goal; do not add their ground again until `readmit`."""
        given = (self.goals == goal).all(axis=1)
        self._given_up = np.concatenate((self._given_up, self.ground[given]))
        self._keep(~given)

    def readmit(self) -> None:
        """Allow ground that was given up to be added again."""
        self._given_up = np.empty((0, 2))

    def _keep(self, kept: np.ndarray) -> None:
        self.goals, self.ground = self.goals[kept], self.ground[kept]
