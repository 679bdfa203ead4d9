"""The local views of a laser: panoramas of what it saw on the last part of its path.

A laser of 180° sees the other half of a corridor on the way back. So a view is the full circle: the
scans of the last metres, joined by odometry, as ranges around the robot. Two panoramas are compared
at all rotations by the sum of absolute differences, as RatSLAM compares panoramic images. The best
ones are then aligned. This gives the robot's pose in the frame of the view that it sees again, and
a match score.

A template is a panorama that was learned as a view. Its frame is the robot's frame at that moment.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import DIRECTIONS, PanoramaConfig
from albot_core.mappers.ratslam.motions import Motion, after, beyond, nearest_turn
from albot_core.mappers.ratslam.panorama_kernels import (
    Surface,
    align,
    compare_turned,
    fill_normals,
    fill_profile,
    gather,
    score_match,
)
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.stored import Stored
from albot_core.sensing.reading import LaserScan

BEAMS = 181
"""Largest number of beams kept; of a scan with more, every second, third and so on is kept."""
_FINEST = 0.01
"""Resolution of the profiles (m)."""
_TURNED = 0.5
"""A scan is also kept if the robot has turned this far since the last one (rad)."""


class ViewMatch(NamedTuple):
    """A view that is seen."""

    view: int
    """The view's number."""
    offset: Motion
    """The robot's pose in the view's frame."""
    score: float
    """Match score of the view with the present panorama, at most 1."""


class Panoramas(Stored):
    """Joins scans to panoramas, learns them as templates, and finds those that are seen again.

    Args:
        config: How panoramas are made and compared.
    """

    SCHEMA = Schema(parts=("_scans", "_templates"))

    def __init__(self, config: PanoramaConfig) -> None:
        self._config = config
        self._scans = Table(
            "scans",
            Field("pose", "3"),  # The robot's pose, in a local frame (m, m, unwrapped rad).
            Field("way"),  # Distance driven (m).
            Field("count", "", int, least=0, most=BEAMS),
            Field("points", f"{BEAMS} 2"),  # In the robot's frame (m).
        )
        self._templates = Table(
            "templates",
            Field("ranges", f"{DIRECTIONS}", least=0),
            Field("points", f"{DIRECTIONS} 2"),
            Field("normals", f"{DIRECTIONS} 2"),
            Field("profile", f"{2 * config.bins}", np.int32, least=0),
            Field("known", f"{2 * config.bins}", np.int32, least=0, most=1),
        )
        self.reset()

    def reset(self) -> None:
        """Forget all scans and templates."""
        self._scans.clear()
        self._templates.clear()
        self._seen = np.zeros(DIRECTIONS)
        self._surface, self._previous = _empty_surface(), _empty_surface()
        self._profile, self._known = np.zeros((2, 2 * self._config.bins), np.int32)

    @property
    def count(self) -> int:
        """Number of templates."""
        return self._templates.count

    @property
    def panorama(self) -> Surface:
        """The present panorama: ranges within the reach, points and normals."""
        return self._surface

    def look(
        self, laser: LaserScan, motion: Motion, view: int, offset: Motion
    ) -> tuple[Motion, Motion, float]:
        """Process a scan, and make the present panorama.

        The scan is aligned with the last panorama, and then with the view that the robot is in. So
        the motion is known better than by odometry alone. The odometer's motion is used if the
        alignments disagree with it or are poor.

        Args:
            laser: The scan.
            motion: The robot's motion since the last scan, by odometry.
            view: The view that the robot is in; -1 for none.
            offset: The robot's pose in that view's frame before this motion.

        Returns:
            The robot's motion, its pose in the view's frame, and the match score of the better
            alignment; 0 if the motion is the odometer's alone.
        """
        self._previous, self._surface = self._surface, self._previous
        self._take(laser, motion)
        score = 0.0
        if view >= 0 and self._scans.count > 1:
            self._fill(self._scans.count - 1)
            moved, score = self._align_scan(motion, view, offset)
            self._amend(motion, moved)
            motion = moved
        self._complete()
        return motion, after(offset, motion), score

    def _take(self, laser: LaserScan, motion: Motion) -> None:
        """Keep a scan, and drop those too far back or too near each other."""
        config, scans = self._config, self._scans
        pose, way = (0.0, 0.0, 0.0), 0.0
        if scans.count:
            pose = after(tuple(scans["pose"][scans.count - 1]), motion)
            way = float(scans["way"][scans.count - 1]) + math.hypot(motion[0], motion[1])
        if scans.count > 1:
            x, y, turn = scans["pose"][scans.count - 1] - scans["pose"][scans.count - 2]
            if math.hypot(x, y) < config.scan_spacing and abs(turn) < _TURNED:
                scans.count -= 1
        past = int((scans.rows("way") < way - config.path_length).sum())
        past = max(past, scans.count + 1 - config.scans)
        if past > 0:
            for name in ("pose", "way", "count", "points"):
                scans[name][: scans.count - past] = scans[name][past : scans.count].copy()
            scans.count -= past
        ranges = np.minimum(laser.ranges, 2 * config.max_range)[:, np.newaxis]
        points = np.asarray(laser.geometry.mount[:2]) + ranges * laser.geometry.directions
        points = points[:: -(-len(points) // BEAMS)]
        padded = np.zeros((BEAMS, 2))
        padded[: len(points)] = points
        scans.append(pose=pose, way=way, count=len(points), points=padded)

    def _fill(self, first: int) -> None:
        """Make the panorama of the scans from `first` on, without its normals."""
        scans, config = self._scans, self._config
        ranges, points, _ = self._surface
        gather(
            (scans.rows("points"), scans.rows("count"), scans.rows("pose")),
            first,
            scans["pose"][scans.count - 1],
            config.max_range,
            self._seen,
            points,
            (np.empty(DIRECTIONS), np.empty((DIRECTIONS, 2))),
        )
        ranges[:] = np.where(self._seen < config.max_range, self._seen, 0.0)

    def _complete(self) -> None:
        """Make the present panorama from all scans that are kept."""
        self._fill(0)
        fill_normals(*self._surface)
        fill_profile(self._seen, self._config.max_range, _FINEST, self._profile, self._known)

    def _align_scan(self, motion: Motion, view: int, offset: Motion) -> tuple[Motion, float]:
        """Return the motion, first aligned with the last panorama, then with the view.

        The odometer's motion is the first guess. The second value is the better match score of the
        alignments that are accepted, 0 if none is.
        """
        config = self._config
        step = math.hypot(motion[0], motion[1]) + abs(motion[2])
        guess, best = motion, 0.0
        pose, score = _match(self._surface, self._previous, motion)
        near = _near(guess, pose, config.max_deviation + config.max_deviation_share * step)
        if near is not None and score >= config.min_score:
            guess, slip, best = near, config.max_deviation / 2, score
        else:
            slip = config.max_deviation + config.max_deviation_share * step
        pose, score = _match(self._surface, self._template(view), after(offset, guess))
        near = _near(guess, beyond(offset, pose), slip)
        if near is not None and score >= config.min_alignment_score:
            guess, best = near, max(best, score)
        return guess, best

    def _amend(self, motion: Motion, moved: Motion) -> None:
        """Correct the last scan's pose: the robot moved by `moved` instead of `motion`."""
        poses, last = self._scans["pose"], self._scans.count - 1
        heading = poses[last, 2] - motion[2]
        cos, sin = math.cos(heading), math.sin(heading)
        x, y = moved[0] - motion[0], moved[1] - motion[1]
        poses[last] += (cos * x - sin * y, sin * x + cos * y, moved[2] - motion[2])

    def learn(self) -> int:
        """Make the present panorama a template; return its view."""
        ranges, points, normals = self._surface
        return self._templates.append(
            ranges=ranges, points=points, normals=normals, profile=self._profile, known=self._known
        )

    def matched_views(
        self, expected: Collection[tuple[int, Motion]], usable: Bool[np.ndarray, "views"]
    ) -> list[ViewMatch]:
        """Return the views that are seen, each once.

        Args:
            expected: Views that should be in sight, and the robot's poses in their frames.
            usable: Which of all views are searched, wherever the robot may be.
        """
        best: dict[int, ViewMatch] = {}
        for view, guess in (*expected, *self._propose(usable)):
            offset, score = _match(self._surface, self._template(view), guess)
            if (
                score < self._config.min_score
                or math.hypot(*offset[:2]) > self._config.max_distance
            ):
                continue
            if view not in best or score > best[view].score:
                best[view] = ViewMatch(view, offset, score)
        return list(best.values())

    def _propose(self, usable: Bool[np.ndarray, "views"]) -> list[tuple[int, Motion]]:
        """Return the views whose profiles differ least, and at which rotations, as guesses."""
        config, templates, count = self._config, self._templates, len(usable)
        if not usable.any():
            return []
        differences, turns = np.empty((count, 2)), np.empty((count, 2), np.int64)
        compare_turned(
            (self._profile, self._known),
            (templates["profile"], templates["known"]),
            count,
            math.ceil(config.overlap * config.bins),
            differences,
            turns,
        )
        differences[~usable] = np.inf
        order = np.argsort(differences[:, 0])[: config.candidates]
        most = config.candidate_ratio * differences[order[0], 0]
        return [
            (int(view), (0.0, 0.0, 2 * math.pi / config.bins * float(turns[view, k])))
            for view in order
            for k in range(2)
            if differences[view, k] <= most and math.isfinite(differences[view, k])
        ]

    def _template(self, view: int) -> Surface:
        table = self._templates
        return table["ranges"][view], table["points"][view], table["normals"][view]

    def _restored(self, state: Arrays) -> None:
        if self._scans.count:
            self._complete()


def _empty_surface() -> Surface:
    return np.zeros(DIRECTIONS), np.zeros((DIRECTIONS, 2)), np.zeros((DIRECTIONS, 2))


def _match(mine: Surface, theirs: Surface, guess: Motion) -> tuple[Motion, float]:
    """Return where one panorama's frame lies in another's, near a guess, and the match score."""
    pose = np.array(guess)
    align(mine[1], theirs, pose)
    score = score_match(mine, theirs, pose, np.empty(3))
    return (float(pose[0]), float(pose[1]), float(pose[2])), score


def _near(guess: Motion, motion: Motion, slip: float) -> Motion | None:
    """Return a motion, unwrapped like the guess, if it is within `slip` (rad) and 2 `slip` (m)."""
    turn = nearest_turn(motion[2] - guess[2])
    far = math.hypot(motion[0] - guess[0], motion[1] - guess[1])
    return (
        (motion[0], motion[1], guess[2] + turn) if far <= 2 * slip and abs(turn) <= slip else None
    )
