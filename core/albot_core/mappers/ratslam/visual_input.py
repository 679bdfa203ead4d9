"""The visual input: it injects activity into the pose cells and selects the experience.

A camera sees one scene at a time. A laser may see several panoramas at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes
from albot_core.mappers.ratslam.motions import Motion, after, before, motion_of, nearest_turn
from albot_core.mappers.ratslam.panoramas import Panoramas, ViewMatch
from albot_core.mappers.ratslam.pose_cells import PoseCells
from albot_core.mappers.ratslam.position import Position
from albot_core.mappers.ratslam.tentative import Tentative
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored
from albot_core.sensing.reading import LaserScan, Reading

Injection = tuple[Float64[np.ndarray, "injected 3"], Float64[np.ndarray, "injected"]]
"""Positions in the pose cells at which activity is injected, and the activity at each."""

_EXPECTED = 4
"""Number of experiences nearest to the robot that are searched at their expected poses."""


class VisualInput(Protocol):
    """The common interface of camera and laser."""

    def reset(self) -> None:
        """Forget everything."""

    def look(self, reading: Reading) -> None:
        """Process a reading."""

    def inject(self) -> Injection:
        """Recognise views, once per iteration; return what they inject."""

    def experience(self) -> None:
        """Enter the active experience of what is seen, or make one."""


class SceneInput(Stored):
    """A camera that recognises scenes by number.

    Args:
        config: All parameters.
        cells: The pose cells.
        links: The links from views to pose cells.
        position: The robot in the experience map.
    """

    SCHEMA = Schema(Field("scenes.since_onset", "3"), parts=("_scenes", "_tentative"))

    def __init__(
        self, config: RatSlamConfig, cells: PoseCells, links: Links, position: Position
    ) -> None:
        self._config, self._cells, self._links, self._position = config, cells, links, position
        self._scenes = Scenes(config.views)
        self._tentative = Tentative(config.experiences, config.pose_cells)
        self.reset()

    def reset(self) -> None:
        """Forget all scenes."""
        self._scenes.reset()
        self._tentative.reset()
        self._seen = NO_VIEW
        self._comes_into_sight = False
        self._since_onset: Motion = (0.0, 0.0, 0.0)  # Motion since the view came into sight.

    def look(self, reading: Reading) -> None:
        """Update the scene that is seen."""
        self._seen = self._scenes.look(reading.scene, self._position.view)

    def inject(self) -> Injection:
        """Return what the scene injects; associate it with cells when it comes into sight."""
        cells, links, position = self._cells, self._links, self._position
        is_new, position.view = self._seen != position.view, self._seen
        self._comes_into_sight = is_new
        if position.view == NO_VIEW:
            return np.zeros((0, 3)), np.zeros(0)
        active = links.activate(position.view, position.iteration)
        is_linked_here = is_new or self._config.views.links_in_sight
        if is_new and self._is_elsewhere():
            self._tentative.see(position.view, cells.packet)
        if is_linked_here and not self._is_unconfirmed():
            links.associate(position.view, active, (0.0, 0.0, 0.0), cells, position.way)
        if is_linked_here:
            self._since_onset = (0.0, 0.0, 0.0)
        linked, amounts = links.injection(position.view, active)
        # Links lead to where the view came into sight, and the robot has moved on since. The
        # network moves with the robot only after the injection.
        there, self._since_onset = self._since_onset, after(self._since_onset, position.since)
        return cells.moved(linked, there), amounts

    def _is_elsewhere(self) -> bool:
        """Return whether the view is known from elsewhere only, and the place by other views."""
        position = self._position
        is_known = position.map.knows(position.view)
        is_active = is_known and position.map.active(position.view, self._cells.packet) >= 0
        return is_known and not is_active and not position.is_novel

    def _is_unconfirmed(self) -> bool:
        """Return whether the view is known from elsewhere only, and may be false here."""
        view, packet = self._position.view, self._cells.packet
        return self._is_elsewhere() and not self._tentative.is_confirmed(view, packet)

    def experience(self) -> None:
        """Find the active experience of the scene, or make one, and learn the transition to it.

        If the scene is known from elsewhere only, the robot stays in the present experience.
        """
        position = self._position
        packet, place, view = self._cells.packet, position.place, position.view
        self._tentative.move(packet)
        found = position.map.active(view, packet)
        table = position.map.experiences
        if found == place and found >= 0:
            table["way"][found] = position.way
        elif self._is_unconfirmed():
            return
        # Without a view, experiences that share pose cells cannot be told apart.
        elif found < 0 or view == NO_VIEW:
            position.enter(position.add(view, packet), (0.0, 0.0, 0.0), is_new=True)
        elif self._config.experiences.at_experiences:
            position.enter(found, (0.0, 0.0, 0.0), is_new=False)
        else:
            # The pose cells give the robot's pose in it. But a view draws the packet sideways onto
            # the line on which it was learned. So across the view, when it comes into sight, the
            # experience's own position is the better guess. Along the view this guess would shrink
            # the map: a robot that turns into a view half-way drives half as far to the next one.
            x, y, turn = motion_of(self._cells.offset(*table["cell"][found].tolist()).tolist())
            offset = x, 0.0 if self._comes_into_sight else y, turn
            position.check(found, offset)
            position.enter(found, *position.smoothed(found, offset), is_new=False)
        position.active, position.scores = [position.place], [1.0]  # Eq. (8): E_V is 1.


class LaserInput(Stored):
    """A laser, whose views are panoramas; each is made with an experience, and shares its frame.

    Args:
        config: All parameters.
        cells: The pose cells.
        links: The links from views to pose cells.
        position: The robot in the experience map.
        name: The mapper's name, for errors.
    """

    SCHEMA = Schema(parts=("_panoramas",))

    def __init__(
        self, config: RatSlamConfig, cells: PoseCells, links: Links, position: Position, name: str
    ) -> None:
        self._config, self._cells, self._links, self._position = config, cells, links, position
        self._name = name
        self._panoramas = Panoramas(config.panoramas)
        self.reset()

    def reset(self) -> None:
        """Forget all panoramas."""
        self._panoramas.reset()
        self._scan: LaserScan | None = None
        self._matches: Sequence[ViewMatch] = ()

    def look(self, reading: Reading) -> None:
        """Keep the scan for an iteration at this reading.

        Raises:
            InputError: The reading lacks a scan.
        """
        self._scan = reading.required_laser(self._name)

    def inject(self) -> Injection:
        """Return what the seen views inject, each at the robot's pose by that view.

        Each view injects in proportion to the probability that the robot is at this pose, and not
        at the pose by another seen view or where no view was learned. The probability is lower for
        a worse match, and for a pose farther from the believed one, relative to the odometer's
        error since the view was last seen.
        """
        links, cells, position = self._links, self._cells, self._position
        self._matches = self._compare()
        config = self._config.panoramas
        weights = [
            (seen.score - config.min_score) / (1.0 - config.min_score) * self._plausible(seen)
            for seen in self._matches
        ]
        total = sum(weights) + config.new_place_weight
        injected: list[Injection] = [(np.zeros((0, 3)), np.zeros(0))]
        for seen, weight in zip(self._matches, weights, strict=True):
            active = links.activate(seen.view, position.iteration)
            if weight > 0.0:
                linked, amounts = links.injection(seen.view, active * weight / total)
                # The network moves with the robot only after the injection.
                there = before(seen.offset, position.since)
                injected.append((cells.moved(linked, there), amounts))
        return tuple(np.concatenate(parts) for parts in zip(*injected, strict=True))  # type: ignore[return-value]

    def _compare(self) -> Sequence[ViewMatch]:
        """Process the scan: update the robot's motion, and return the views that are seen."""
        position, panoramas = self._position, self._panoramas
        assert self._scan is not None, "an iteration follows a look"
        start = before(position.here, position.since)
        position.since, position.here, score = panoramas.look(
            self._scan, position.since, position.place, start
        )
        position.doubt += (1.0 - score) * math.hypot(*position.since[:2])
        if position.place < 0:
            return ()
        poses, believed = position.map.poses, position.believed
        apart = np.hypot(*(poses[:, :2] - believed[:2]).T)
        near = np.argsort(apart)[:_EXPECTED]
        expected = [
            (int(view), motion_of(relative(poses[view], believed).tolist()))
            for view in near[apart[near] < self._config.panoramas.max_distance]
        ]
        return panoramas.matched_views(expected, self._links.linked(position.map.count))

    def _plausible(self, seen: ViewMatch) -> float:
        """Return how plausible the robot's error is if a match is right, from 0 to 1.

        The error grows with the way since the view was last seen, and the less, the better the
        scans along that way were aligned.
        """
        config, position = self._config.panoramas, self._position
        table = position.map.experiences
        way = position.way - float(table["way"][seen.view])
        way = min(way, (position.doubt - float(table["doubt"][seen.view])) / config.doubtful)
        pose = compose(position.map.poses[seen.view], np.array(seen.offset))
        x, y, turn = relative(position.believed, pose).tolist()
        spread, turn_spread = (
            config.spread + config.drift * way,
            (config.turn_spread + config.turn_drift * way),
        )
        return math.exp(
            -0.5 * ((x * x + y * y) / spread**2 + (nearest_turn(turn) / turn_spread) ** 2)
        )

    def experience(self) -> None:
        """Find the active experience of the views that are seen, or make one with a new view.

        A view and its experience share their number and their frame. An experience is active if the
        packet lies where the view puts it and the robot is in the experience's zone, with any
        heading.
        """
        config, position = self._config.experiences, self._position
        table, place = position.map.experiences, position.place
        active, most = -1, 0.0
        offset: Motion = (0.0, 0.0, 0.0)
        sees_place = False
        energies: list[tuple[float, int, float]] = []
        for seen in self._matches:
            if seen.score < config.min_score:
                continue
            sees_place |= seen.view == place
            x, y, turn = self._cells.offset(*table["cell"][seen.view].tolist()).tolist()
            off = math.hypot(x - seen.offset[0], y - seen.offset[1]) / config.radius
            turned = abs(nearest_turn(turn - seen.offset[2])) / config.turn
            away = math.hypot(*seen.offset[:2]) / config.radius
            is_in_zone = max(off, turned, away) < 1.0
            energy = seen.score * ((1.0 - away) + (1.0 - turned)) if is_in_zone else 0.0  # Eq. (9).
            if energy > 0.0 or seen.view == place:
                energies.append((energy, seen.view, seen.score))
            if energy > most:
                active, most, offset = seen.view, energy, seen.offset
        energies.sort(reverse=True)
        position.active = [view for _, view, _ in energies]
        position.scores = [min(score, 1.0) for _, _, score in energies]
        if active == place and active >= 0:
            position.mark(active)
            return
        is_new = active < 0
        if is_new:
            if sees_place and math.hypot(*position.here[:2]) < config.spacing:
                return
            active = position.add(self._panoramas.learn(), self._cells.packet)
        position.view = active
        position.enter(active, offset, is_new=is_new)
        self._links.associate(active, 1.0, offset, self._cells, position.way)
