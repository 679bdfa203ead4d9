"""The localiser: where in a known map the robot is, without a start pose.

A *look* is a scan that is weighed; looks are some distance or turn apart. Until the robot is
localised, scans are matched with the latest ones, so that the looks' relative poses are known well.
Searches of the whole map (`search`) propose hypotheses; each is weighed by all looks (`evidence`),
moves with the robot, and is aligned with the map at each look. The hypotheses, and the hypothesis
that the robot is nowhere in the map, share one probability (Bayes; S. Thrun, W. Burgard and D. Fox,
Probabilistic Robotics, 2005, sections 7.4 and 8.3; P. Jensfelt and S. Kristensen, Active global
localisation for a mobile robot using multiple hypothesis tracking, T-RA 2001). One is believed only
if a second look, from elsewhere, at walls that the first one did not show, leaves no other.

A localised robot is tracked by matching each scan with the map. It is lost if its looks no longer
fit; then the search begins anew.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative, transform_points
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.evidence import EXPLAINED, weigh_poses
from albot_core.localisation.known_map import CELL, KnownMap
from albot_core.localisation.search import keep_apart, search_map
from albot_core.mappers.schema import Arrays, Field, Pack, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.local_map import (
    LocalMap,
    OdometerErrors,
    match_scan,
    scan_points,
)
from albot_core.mappers.stored import Stored
from albot_core.matching.correlation import Window, correlate
from albot_core.matching.refinement import refine
from albot_core.matching.scan_points import matched_points
from albot_core.sensing.reading import LaserScan

UNDECIDED, LOCALISED, LOST = 0, 1, 2
"""What the robot knows of its pose: several are possible, or the search has just begun; one is
believed; it was lost, or most likely is nowhere in the map."""
STATES = ("undecided", "localised", "lost")
"""The names of these."""
_NEAR = Window(0.25, math.radians(4.0), math.radians(1.0))
"""The window in which a hypothesis is aligned with the map."""
_ALIGNED = 3
"""Number of latest looks with which a hypothesis is aligned."""
_ALIGNED_POINTS = 120
"""Number of their points that are used at most."""
_JOINED = 8
"""Number of latest looks that are searched for together before a hypothesis is believed."""
_HOPELESS = 30.0
"""A hypothesis is dropped if the evidence for another is larger by this."""


class Look(NamedTuple):
    """A scan that is weighed."""

    pose: Pose
    """The robot's pose: in the local frame of the search, or on the map once it is localised."""
    points: Points
    """The ends of the beams in the robot's frame (m)."""


class Hypothesis(NamedTuple):
    """A pose at which the robot may be."""

    pose: Pose
    """The pose on the map."""
    probability: float
    """Its probability."""
    share: float
    """Share of the beams of the looks that the map explains."""


def _check_looks(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless a state's looks hold all points."""
    found = int(state["looks.counts"].sum())
    refuse_unless(found == len(state["looks.points"]), "looks.counts", "the points' number", found)


class Localiser(Stored):
    """Where one robot is in a known map.

    Args:
        known: The map.
        config: All parameters.
    """

    SCHEMA = Schema(
        Field("here", "3", at="_here"),
        Field("local", "3", at="_local_pose"),
        Field("errors", "2", at="_errors.variances", least=0),
        Pack(
            "counts",
            int,
            Field("is", "", int, at="standing", least=UNDECIDED, most=LOST),
            Field("begun", "", int, least=0, most=1),
        ),
        Pack("ways", float, Field("since"), Field("way", least=0), Field("searched", least=-1)),
        Field("eye", "2", at="_eye"),
        Field("looks.poses", "looks 3", at=None),
        Field("looks.counts", "looks", int, at=None, least=0),
        Field("looks.points", "look_points 2", at=None),
        Field("hypotheses.poses", "hypotheses 3", at="_poses"),
        Field("hypotheses.evidence", "hypotheses looks", at="_evidence"),
        Field("hypotheses.shares", "hypotheses looks", at="_shares", least=0, most=1),
        parts=("_follower",),
        rules=(_check_looks,),
    )

    def __init__(self, known: KnownMap, config: LocaliserConfig) -> None:
        self.known, self.config = known, config
        self._follower = LocalMap(config.following)
        self._errors = OdometerErrors(config.tracking)
        self._cells = max(known.open_area, 1.0) / 0.25 * (2.0 * math.pi / config.apart_turn)
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next scan is the first."""
        self.standing = UNDECIDED
        self._here = np.zeros(3)
        self._errors.reset()
        self._eye = np.zeros(2)
        self._begin_search()

    def _begin_search(self) -> None:
        """Forget all looks and hypotheses."""
        self._follower.reset()
        self._local_pose = np.zeros(3)
        self._begun = 0
        self._since = self._way = 0.0
        self._searched = -1.0
        self._looks: list[Look] = []
        self._forget_hypotheses()

    def _forget_hypotheses(self) -> None:
        self._poses: Poses = np.empty((0, 3))
        self._evidence: Float64[np.ndarray, "hypotheses looks"] = np.empty((0, len(self._looks)))
        self._shares: Float64[np.ndarray, "hypotheses looks"] = np.empty((0, len(self._looks)))

    @property
    def pose(self) -> Pose:
        """The likeliest pose on the map; without any, the motion since the search began."""
        return self._here

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The possible poses, the likeliest first; their probabilities sum to at most 1."""
        if self.standing == LOCALISED:
            share = float(self._shares[0].mean()) if self._shares.size else 1.0
            return (Hypothesis(self._here.copy(), 1.0, share),)
        probabilities, _ = self._weights()
        order = np.argsort(-probabilities, kind="stable")
        return tuple(
            Hypothesis(
                self._poses[k].copy(), float(probabilities[k]), float(self._shares[k].mean())
            )
            for k in order.tolist()
        )

    def update(self, scan: LaserScan, motion: Pose) -> None:
        """Process a scan.

        Args:
            scan: The scan.
            motion: The motion since the last scan; ignored at the first one.
        """
        self._eye = np.array(scan.geometry.mount[:2])
        if self.standing == LOCALISED:
            self._track(scan, motion)
        else:
            self._search(scan, motion)

    def believe(self, pose: Pose) -> None:
        """Believe a pose, as a robot does that is told where it is; the next scans are matched."""
        self._begin_search()
        self.standing, self._here = LOCALISED, pose.copy()
        self._poses = pose[None].copy()
        self._evidence, self._shares = np.empty((1, 0)), np.empty((1, 0))
        self._errors.reset()

    def _search(self, scan: LaserScan, motion: Pose) -> None:
        """Follow the robot, and at a look weigh the hypotheses."""
        points = scan_points(scan, self.config.following)
        before = self._local_pose
        if self._begun:
            match = self._follower.match(points, compose(before, motion))
            self._local_pose = match.pose
        step = relative(before, self._local_pose)
        self._way += math.hypot(step[0], step[1])
        if not self._begun or self._follower.is_due(self._local_pose):
            self._follower.keep(self._local_pose, points.surface)
        self._begun = 1
        if len(self._poses):
            self._poses = compose(self._poses, step)
        if self._is_look_due(self._local_pose):
            self._look(scan)
            self._weigh_latest()
            if self._searched < 0 or self._way - self._searched >= self.config.search_every:
                self._propose(_ALIGNED)
            self._decide()
        if len(self._poses):
            self._here = self._poses[int(np.argmax(self._evidence.sum(axis=1)))].copy()
        else:
            self._here = self._local_pose.copy()

    def _is_look_due(self, pose: Pose) -> bool:
        """Return whether the robot has moved or turned far enough since the last look."""
        if not self._looks:
            return True
        x, y, turn = relative(self._looks[-1].pose, pose).tolist()
        return math.hypot(x, y) >= self.config.step or abs(turn) >= self.config.turn

    def _look(self, scan: LaserScan) -> None:
        """Remember a scan as the latest look; forget those that no longer count."""
        evidence = self.config.evidence
        points, _ = matched_points(scan, evidence.reach, evidence.spacing)
        pose = self._here if self.standing == LOCALISED else self._local_pose
        self._looks.append(Look(pose.copy(), points))
        if len(self._looks) > self.config.looks:
            # The first look stays: the decision compares the others with it.
            del self._looks[1]
            self._evidence = np.delete(self._evidence, 1, axis=1)
            self._shares = np.delete(self._shares, 1, axis=1)

    def _latest_points(self, most: int) -> Points:
        """Return the points of the latest looks, in the robot's present frame (m)."""
        parts = [
            transform_points(relative(self._looks[-1].pose, look.pose), look.points)
            for look in self._looks[-most:]
        ]
        points = np.concatenate(parts)
        if len(points) > _ALIGNED_POINTS:
            points = points[np.linspace(0, len(points) - 1, _ALIGNED_POINTS).astype(int)]
        return points

    def _align(self, poses: Poses, points: Points) -> Poses:
        """Return poses aligned with the map, each within a small window."""
        aligned, normals = np.empty_like(poses), np.zeros_like(points)
        none = np.zeros(3)
        for k, pose in enumerate(poses):
            best = correlate(self.known.field, points, pose, _NEAR, none)
            aligned[k] = refine(self.known.field, points, normals, best.pose, pose, none).pose
        return aligned

    def _weigh_latest(self) -> None:
        """Align the hypotheses with the map, and weigh them by the latest look."""
        if len(self._poses):
            self._poses = self._align(self._poses, self._latest_points(_ALIGNED))
        look = self._looks[-1]
        evidence, shares = self._weigh(self._poses, look.points)
        self._evidence = np.column_stack((self._evidence, evidence))
        self._shares = np.column_stack((self._shares, shares))

    def _weigh(self, poses: Poses, points: Points) -> tuple[np.ndarray, np.ndarray]:
        return weigh_poses(self.known.ground, poses, points, self._eye, self.config.evidence)

    def _propose(self, most: int) -> None:
        """Search the map for further hypotheses by the latest looks, and weigh them by all looks.

        Args:
            most: Number of latest looks that are searched for, at most.
        """
        config, self._searched = self.config, self._way
        points = self._latest_points(most)
        near = points[np.hypot(*points.T) <= config.search_reach]
        apart = config.apart, config.apart_turn
        found, _ = search_map(
            self.known, near, config.heading_step, config.search_share, config.candidates, apart
        )
        if not len(found):
            return
        found = self._align(found, points)
        last = self._looks[-1].pose
        columns = [
            self._weigh(compose(found, relative(last, look.pose)), look.points)
            for look in self._looks
        ]
        evidence = np.column_stack([column[0] for column in columns])
        shares = np.column_stack([column[1] for column in columns])
        self._poses = np.concatenate((self._poses, found))
        self._evidence = np.concatenate((self._evidence, evidence))
        self._shares = np.concatenate((self._shares, shares))

    def _prune(self) -> None:
        """Keep the best of the hypotheses that are one, and at most so many."""
        if not len(self._poses):
            return
        config, total = self.config, self._evidence.sum(axis=1)
        order = np.argsort(-total, kind="stable")
        order = order[total[order] >= total.max(initial=-math.inf) - _HOPELESS]
        poses = self._poses[order]
        kept = order[keep_apart(poses, config.apart, config.apart_turn, config.hypotheses)]
        self._poses, self._evidence = self._poses[kept], self._evidence[kept]
        self._shares = self._shares[kept]

    def _weights(self) -> tuple[Float64[np.ndarray, "hypotheses"], float]:
        """Return the probability of each hypothesis, and that the robot is at none of them.

        Small differences of a look between hypotheses are errors of map and alignment, which add up
        over looks at the same walls. So only what exceeds `indifference` tells them apart.
        """
        unlike, nowhere = self.config.unlike, math.log(self.config.unlike)
        if not len(self._evidence):
            return np.empty(0), 1.0
        total = self._evidence.sum(axis=1)
        best = int(np.argmax(total))
        apart = self._evidence - self._evidence[best]
        clear = np.sign(apart) * np.maximum(np.abs(apart) - self.config.indifference, 0.0)
        logs = total[best] + clear.sum(axis=1) + math.log((1.0 - unlike) / self._cells)
        most = max(float(logs.max()), nowhere)
        weights, rest = np.exp(logs - most), math.exp(nowhere - most)
        sum_of_all = float(weights.sum()) + rest
        return weights / sum_of_all, rest / sum_of_all

    def _decide(self) -> None:
        """Believe the best hypothesis if no other is left; or call the robot lost."""
        self._prune()
        best = self._likeliest()
        if best >= 0 and self._is_sure(best) and self._searched < self._way:
            # Rivals that earlier searches have missed get a last chance, by more looks together.
            self._propose(_JOINED)
            self._prune()
            best = self._likeliest()
        if self._way >= self.config.nowhere:
            self.standing = LOST if best < 0 else UNDECIDED
        if best < 0 or not self._is_sure(best):
            return
        last = self._looks[-1].pose
        here = self._poses[best].copy()
        looks = [
            Look(compose(here, relative(last, look.pose)), look.points) for look in self._looks
        ]
        self.standing, self._here, self._looks = LOCALISED, here, looks
        self._poses = here[None]
        self._evidence, self._shares = self._evidence[[best]], self._shares[[best]]
        self._errors.reset()
        self._follower.reset()

    def _likeliest(self) -> int:
        """Return the likeliest hypothesis, if it is likelier than none and the map explains it.

        Otherwise -1: the robot is most likely nowhere in the map.
        """
        probabilities, nowhere = self._weights()
        best = int(np.argmax(probabilities)) if len(probabilities) else -1
        return best if best >= 0 and nowhere < 0.5 and self._fits(best) else -1

    def _is_sure(self, which: int) -> bool:
        """Return whether a hypothesis is probable enough, and was confirmed from elsewhere."""
        probabilities, _ = self._weights()
        return bool(probabilities[which] >= self.config.certain) and self._has_looked_again(which)

    def _fits(self, which: int) -> bool:
        """Return whether the map explains enough of all looks, and of the worst of them."""
        shares = np.sort(self._shares[which])
        worst = shares[: -(-len(shares) // 3)]
        return bool(shares.mean() >= self.config.share and worst.mean() >= self.config.worst_share)

    def _has_looked_again(self, which: int) -> bool:
        """Return whether later looks, from elsewhere, show walls that the first one did not."""
        first, last = self._looks[0].pose, self._looks[-1].pose
        if math.dist(first[:2], last[:2]) < self.config.elsewhere:
            return False
        frame = compose(self._poses[which], relative(last, np.zeros(3)))
        patches = [self._patches(compose(frame, look.pose), look.points) for look in self._looks]
        later = set().union(*patches[1:])
        return len(later - patches[0]) >= self.config.new_walls

    def _patches(self, pose: Pose, points: Points) -> set[tuple[int, int]]:
        """Return the pieces of wall that a look at a pose explains."""
        on_map = transform_points(pose, points)
        ground = self.known.ground
        cells = np.floor((on_map - ground.corner) / CELL).astype(int)
        inside = ((cells >= 0) & (cells < np.array(ground.kinds.shape)[::-1])).all(axis=1)
        cells, on_map = cells[inside], on_map[inside]
        near = ground.distances[cells[:, 1], cells[:, 0]] <= EXPLAINED
        pieces = np.floor(on_map[near] / self.config.patch).astype(int)
        return {(x, y) for x, y in pieces.tolist()}

    def _track(self, scan: LaserScan, motion: Pose) -> None:
        """Match a scan with the map; at a look, ask whether the robot is lost."""
        config = self.config
        points = scan_points(scan, config.tracking)
        guess = compose(self._here, motion)
        match = match_scan(self.known.field, points, guess, self._errors, config.tracking)
        self._here = match.pose
        self._poses = self._here[None]
        if not self._is_look_due(self._here):
            return
        self._look(scan)
        evidence, shares = self._weigh(self._poses, self._looks[-1].points)
        self._evidence = np.column_stack((self._evidence, evidence))
        self._shares = np.column_stack((self._shares, shares))
        latest = self._shares[0, -config.lost_looks :]
        if len(latest) == config.lost_looks and latest.mean() < config.lost_share:
            self.standing = LOST
            self._begin_search()
            self._search(scan, motion)

    def _stored(self) -> dict[str, Any]:
        return {
            "looks.poses": [look.pose for look in self._looks],
            "looks.counts": [len(look.points) for look in self._looks],
            "looks.points": np.concatenate([np.empty((0, 2)), *(k.points for k in self._looks)]),
        }

    def _restored(self, state: Arrays) -> None:
        ends = np.cumsum(state["looks.counts"])[:-1]
        parts = np.split(state["looks.points"].copy(), ends)[: len(state["looks.poses"])]
        poses = state["looks.poses"].copy()
        self._looks = [Look(pose, part) for pose, part in zip(poses, parts, strict=True)]
