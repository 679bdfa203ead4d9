"""The gap explorer: goes to the nearest gap in view behind which the ground is new.

After the exploration of Yeap et al., Autonomous Robot Mapping by Landmark Association
(2015): the robot moves towards a near gap that is wide enough for it. Gaps and open
ground that it passes by are remembered, for when there is nothing new in view.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.pose_kernels import bearings_of
from albot_core.geometry.types import Points
from albot_core.planning.explorer import Explorer
from albot_core.planning.gaps import find_gaps
from albot_core.planning.prospects import Prospects
from albot_core.planning.senses import Senses
from albot_core.planning.sketch import Ways
from albot_core.planning.steering import SteeringConfig
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields


@dataclass(frozen=True, kw_only=True)
class GapExplorerConfig:
    """What the explorer goes for."""

    gap_width: float = 0.6
    """Narrower openings are no gaps (m): the robot does not fit."""
    reach: float = 6.5
    """Gaps and ground farther away are left for later (m)."""
    clearance: float = 0.4
    """Ground nearer than this to anything is not gone for (m)."""
    turn_cost: float = 0.7
    """Way (m) that a turn of one radian counts as."""
    gain: float = 0.0
    """Way (m) that ground all new about a place is worth: with more, the nearest pocket waits
    where a whole room lies open."""
    chance: float = 0.5
    """Way (m) up to which chance outweighs nearness: no two tours are the same."""
    steering: SteeringConfig = field(default_factory=SteeringConfig)
    """How it gets there."""
    worth: float = 0.75
    """Share of the ground about a place that must be new for it to be gone to; where there is
    no such place any more, any that is new."""
    near: float = 2.0
    """Ground in view and no farther away than this is covered (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "gap_width", "reach", "clearance", "near", "worth")
        check_fields(self, NOT_NEGATIVE, "turn_cost", "gain", "chance")


class GapExplorer(Explorer):
    """Goes from gap to gap, the nearest first, and back to those passed by.

    Args:
        config: What it goes for.
    """

    _LOOK_EVERY = 3
    """Steps between two looks for prospects: the robot moves two hand's breadths meanwhile."""
    _SURROUNDINGS = 1.5
    """Half the side of the square (m) about a place whose new ground is gained there."""
    _FAN = np.radians(6.0)
    """Angle between the beams along which it looks for open ground (rad)."""

    def __init__(self, config: GapExplorerConfig = GapExplorerConfig()) -> None:
        super().__init__(config.near, config.steering)
        self._config = config

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, by looking all around."""
        super().reset(rng)
        self._prospects = Prospects()
        self._least = self._config.worth

    def _take_in(self, senses: Senses) -> None:
        """Draw what is in view, and note what is worth going to."""
        self._sketch.draw(senses)
        if self._steps % self._LOOK_EVERY == 0:
            self._note_gaps(senses)
            ground = self._open_ground(senses)
            self._prospects.note(ground, ground)
            self._prospects.forget_covered(self._sketch, senses.pose, self._least)
            if self._goal is not None and not self._prospects.holds(self._goal):
                self._goal = None
        self._steps += 1

    def _note_gaps(self, senses: Senses) -> None:
        """Gaps are gone to for the ground that they hide."""
        config = self._config
        gaps = find_gaps(senses.points, narrowest=config.gap_width, reach=config.reach)
        if gaps:
            centres = np.stack([gap.centre for gap in gaps])
            hidden = np.stack([gap.beyond(2 * config.clearance) for gap in gaps])
            centres, hidden = senses.to_map(centres), senses.to_map(hidden)
            new = self._is_new(hidden)
            self._prospects.note(centres[new], hidden[new])

    def _open_ground(self, senses: Senses) -> Float64[np.ndarray, "places 2"]:
        """Points in view, on a fan of beams, not covered yet, at which the robot could stand.

        In the map's frame (m).
        """
        config, laser = self._config, senses.laser
        distances = np.arange(1.0, config.reach, 1.0)
        beams = np.arange(0, laser.beams, max(1, round(self._FAN / laser.spacing)))
        free = senses.ranges[beams, None] - config.clearance > distances
        fan = (laser.directions[beams, None] * distances[:, None])[free]
        fan = fan[self._is_new(senses.to_map(fan))]
        apart = fan[:, None] - senses.points
        clear = (np.hypot(apart[..., 0], apart[..., 1]) > config.clearance).all(axis=1)
        return senses.to_map(fan[clear])

    def _is_new(self, ground: Points) -> Bool[np.ndarray, "places"]:
        """Whether ground (m, map frame) is worth going to."""
        left = self._sketch.uncovered(ground)
        return np.asarray((left > 0) & (left >= self._least))

    def _give_up_where_vain(self, senses: Senses) -> None:
        """Drop a goal that cannot be come nearer, or that takes too long."""
        if self._goal is None:
            return
        stuck = self._patience.lost(senses.pose)
        arrived = len(self._route) and np.hypot(*(self._route[-1] - senses.pose[:2])) < 0.3
        if stuck or arrived:
            self._prospects.give_up(self._goal)
            self._goal = None
        if stuck:
            self._patience.recover(self._rng)

    def _plan(self, senses: Senses) -> None:
        """Find the way to the goal anew; choose a goal where there is none or no way to it."""
        sketch = self._sketch
        if self._goal is not None:
            self._route = sketch.route(sketch.ways(senses.pose, goal=self._goal), self._goal)
            if len(self._route):
                return
        ways = sketch.ways(senses.pose)
        self._goal = self._choose(senses, ways)
        if self._goal is not None:
            self._route = sketch.route(ways, self._goal)

    def _choose(self, senses: Senses, ways: Ways) -> Float64[np.ndarray, "2"] | None:
        """The prospect with the shortest way, all else counted in; None if none is left.

        Yeap et al. go to the nearest gap; that the ground behind it can count, too, is ours.
        """
        config, goals = self._config, self._prospects.goals
        lengths = np.array([self._sketch.length(ways, goal) for goal in goals])
        if not np.isfinite(lengths).any():
            self._prospects.pardon()
            self._least = 0.0
            self._look_round.begin()
            return None
        turns = np.abs(bearings_of(senses.to_robot(goals)))
        chances = config.chance * self._rng.random(len(goals))
        gains = config.gain * self._sketch.uncovered(self._prospects.ground, self._SURROUNDINGS)
        chosen = int((lengths + config.turn_cost * turns + chances - gains).argmin())
        self._patience.begin(float(lengths[chosen]))
        return np.array(goals[chosen])
