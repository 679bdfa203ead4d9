"""The gap explorer: drives to the nearest visible gap with new ground behind it.

After the exploration of Yeap et al., Autonomous Robot Mapping by Landmark Association
(2015): the robot moves towards a near gap that is wide enough for it. It remembers gaps and
open ground that it passes, and returns to them when nothing new is in view.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.pose_kernels import bearings_of, length_of
from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel
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
        return percept.to_map(fan[_are_clear(fan, percept.points, config.goal_radius)])

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
    return [
        Gap(centre=np.array(centre), outward=np.array(outward), width=width)
        for centre, outward, width in _find_gaps(points, narrowest, reach)
    ]


@kernel(arrays=True)
def _find_gaps(
    points: np.ndarray, narrowest: float, reach: float
) -> list[tuple[tuple[float, float], tuple[float, float], float]]:
    """Return centre, outward direction and width of each gap (see `find_gaps`)."""
    count = points.shape[0]
    gaps = []
    for k in range(count - 1):
        near = length_of(points[k, 0], points[k, 1])
        far = length_of(points[k + 1, 0], points[k + 1, 1])
        if not abs(far - near) > narrowest or _is_one_surface(points, k):
            continue
        edge, first, end = (k, k + 1, count) if near < far else (k + 1, 0, k + 1)
        ex, ey = points[edge, 0], points[edge, 1]
        width, nearest = np.inf, first
        for i in range(first, end):
            across = length_of(points[i, 0] - ex, points[i, 1] - ey)
            if across < width:
                width, nearest = across, i
        ox, oy = points[nearest, 0], points[nearest, 1]
        x, y = (ex + ox) / 2, (ey + oy) / 2
        if width > narrowest and length_of(x, y) <= reach:
            u, v = -(oy - ey) / max(width, 1e-9), (ox - ex) / max(width, 1e-9)
            if u * x + v * y < 0:
                u, v = -u, -v
            gaps.append(((x, y), (u, v), width))
    return gaps


@kernel()
def _is_one_surface(points: np.ndarray, k: int) -> bool:
    """Return whether beams k and k + 1 hit the same wall, whose range jumps at a grazing angle.

    They do if the line through the points on one side continues to the point on the other side.
    """
    runs_on = False
    if k >= 2:
        runs_on |= _off_line(points[k - 2], points[k], points[k + 1]) < _SAME_SURFACE
    if k + 3 < points.shape[0]:
        runs_on |= _off_line(points[k + 3], points[k + 1], points[k]) < _SAME_SURFACE
    return runs_on


@kernel()
def _off_line(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> float:
    """Return the distance (m) of a point from the line through two others."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    px, py = point[0] - end[0], point[1] - end[1]
    distance: float = abs(dx * py - dy * px) / max(length_of(dx, dy), 1e-9)
    return distance


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
        new = _find_apart(ground, self.ground, self._given_up, self._spacing)
        self.goals = np.concatenate((self.goals, goals[new]))
        self.ground = np.concatenate((self.ground, ground[new]))

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


@kernel(arrays=True)
def _are_clear(places: np.ndarray, obstacles: np.ndarray, radius: float) -> np.ndarray:
    """Return whether no obstacle lies within a radius (m) of each place (n, 2)."""
    clear = np.ones(places.shape[0], np.bool_)
    for i in range(places.shape[0]):
        for k in range(obstacles.shape[0]):
            x, y = obstacles[k, 0] - places[i, 0], obstacles[k, 1] - places[i, 1]
            if length_of(x, y) <= radius:
                clear[i] = False
                break
    return clear


@kernel(arrays=True)
def _find_apart(
    ground: np.ndarray, kept: np.ndarray, given_up: np.ndarray, spacing: float
) -> np.ndarray:
    """Return which places (n, 2) are `spacing` (m) away from all others and all chosen before."""
    chosen: np.ndarray = _are_clear(ground, kept, spacing) & _are_clear(ground, given_up, spacing)
    for i in range(ground.shape[0]):
        for k in range(i):
            if chosen[i] and chosen[k]:
                x, y = ground[i, 0] - ground[k, 0], ground[i, 1] - ground[k, 1]
                chosen[i] = length_of(x, y) > spacing
    return chosen
