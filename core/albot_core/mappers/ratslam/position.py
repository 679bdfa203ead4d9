"""The robot's position in the experience map, and what it learns of the map (section 4.2).

A position is an experience, and a pose in its frame. The pose is integrated from odometry since the
robot entered the experience.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.experiences import SCENE_TURN, ExperienceMap
from albot_core.mappers.ratslam.local_views import NO_VIEW
from albot_core.mappers.ratslam.motions import Motion, after, before, motion_of, nearest_turn
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.ratslam.verification import Transition, Verification
from albot_core.mappers.ratslam.winding import HeadingBias
from albot_core.mappers.schema import Arrays, Field, Pack, Schema
from albot_core.mappers.stored import Stored


class Position(Stored):
    """The robot in the experience map.

    Args:
        config: All parameters.
    """

    SCHEMA = Schema(
        Pack(
            "counts",
            int,
            Field("view", at="view", least=-1),
            Field("place", at="place", least=-1, below="experiences"),
            Field("matched", at="matched", least=-1, below="history"),
            Field("iteration", at="iteration", least=0),
            Field("left_in", least=0),
            Field("updates", at="updates", least=0),
            Field("version", at="version", least=0),
        ),
        Pack(
            "numbers",
            float,
            Field("stamp", at="stamp"),
            Field("left_at"),
            Field("way", at="way"),
            Field("doubt", at="doubt", least=0),
            Field("variance"),
            Field("weight"),
            Field("since", "3", at="since"),
            Field("here", "3", at="here"),
        ),
        Field(
            "active.place",
            "active_places",
            int,
            at="active",
            least=0,
            below="experiences",
            once=True,
        ),
        Field("active.score", "active_places", at="scores", least=0, most=1),
        parts=("_bias", "map", "_verification", "visits"),
    )

    def __init__(self, config: RatSlamConfig) -> None:
        self._config = config
        self.map = ExperienceMap(config.experiences, config.pose_cells, config.correction)
        self.visits = Table("visits", Field("place", "", int, least=0, below="experiences"))
        """The experiences that the robot was in, in order."""
        self._bias, self._verification = HeadingBias(), Verification()
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        for part in (self.map, self.visits):
            part.clear()
        self._bias.reset()
        self._verification.reset()
        self.stamp = self._left_at = 0.0
        self.way = 0.0
        """Distance driven (m)."""
        self.doubt = 0.0
        """The same, each motion times the share of directions that disagree after its alignment."""
        self.since: Motion = (0.0, 0.0, 0.0)
        """The robot's motion since the last iteration."""
        self.here: Motion = (0.0, 0.0, 0.0)
        """The robot's pose in the present experience's frame."""
        self._variance = 0.0
        """Variance of that pose, as a share of that of a pose by one scene."""
        self.view = NO_VIEW
        """The view that is seen."""
        self.place = self.matched = -1
        """The present experience, and the reading at which a recognised one was made; -1 for
        none."""
        self.active: list[int] = []
        """The present experience, if it is seen, and all that are active; the most energetic
        first."""
        self.scores: list[float] = []
        """Match scores of the views of `active`, from 0 to 1."""
        self.reading = 0
        """Number of readings before this one."""
        self.iteration = self._left_in = self.updates = self.version = 0
        self.dropped: tuple[np.ndarray, Poses] | None = None
        """Poses by odometry at the last readings, and the experiences in whose frames they are.
        They replace those by a re-localisation that was just dropped; None if none was."""
        self._weight = 0.0
        """The weight of the view when a known experience was last entered; 0 if none ever was."""

    def integrate(self, motion: Motion, stamp: float) -> None:
        """Integrate a motion of the odometer."""
        way = math.hypot(motion[0], motion[1])
        self._bias.add(way, motion[2], stamp - self.stamp)
        self.way += way
        self.since = after(self.since, motion)
        self.here = after(self.here, motion)
        self._verification.integrate(motion)

    @property
    def believed(self) -> Pose:
        """The robot's pose in the map."""
        if self.place < 0:
            return np.zeros(3)
        return compose(self.map.poses[self.place], np.array(self.here))

    @property
    def is_novel(self) -> bool:
        """Whether the map has no experience in whose zone the robot is believed to be."""
        config, believed = self._config.experiences, motion_of(self.believed.tolist())
        return not is_any_near(self.map.poses, believed, (config.radius, config.turn))

    def add(self, view: int, packet: Packet) -> int:
        """Make an experience at the robot's pose, by odometry alone if one is pending."""
        verification, base, pose = self._verification, self.place, self.here
        if verification.anchor >= 0:
            base, pose = verification.anchor, verification.from_anchor
        if base >= 0:
            pose = after(motion_of(self.map.poses[base].tolist()), pose)
        self.updates += 1
        return self.map.add(pose, packet, view, 0.0, self.reading)

    def enter(
        self, experience: int, offset: Motion, variance: float = 0.0, *, is_new: bool
    ) -> None:
        """Enter another experience, and learn the transition to it.

        Args:
            experience: The experience to enter.
            offset: The robot's pose in its frame.
            variance: Variance of that pose, as a share of that of a pose by one scene; 0 if it is
                as good as the odometer's.
            is_new: Whether it was just made.
        """
        table, config = self.map.experiences, self._config.experiences
        is_earlier = self.way - table["way"][experience] >= config.min_revisit_distance
        recognised = is_earlier and not is_new
        self.matched = int(table["reading"][experience]) if recognised else -1
        if is_new:  # It lies where odometry from the anchor puts it, and so did the way to it.
            self._drop_poses()
        if self.place >= 0:
            motion = before(self.here, offset)
            time, steps = self.stamp - self._left_at, self.iteration - self._left_in
            # The errors of the robot's poses in both experiences add up in the motion.
            spread = self._variance + variance
            transition = Transition(self.place, experience, motion, time, spread, steps)
            for each in self._verification.process(
                transition, self.stamp, self.iteration, config.confirmations, is_new=is_new
            ):
                self._connect(each)
        if not is_new:
            self._verification.enter(experience, offset)
        self.mark(experience)
        self.place, self.here, self._variance = experience, offset, variance
        self._left_at, self._left_in = self.stamp, self.iteration
        self.visits.append(place=experience)
        self.version += 1

    def mark(self, experience: int) -> None:
        """Note that the robot is in an experience."""
        table = self.map.experiences
        table["way"][experience], table["doubt"][experience] = self.way, self.doubt

    @property
    def recognised(self) -> list[int]:
        """Indices in `active` of the experiences that are known from before, the present one first.

        None if the present one is not recognised.
        """
        if self.matched < 0:
            return []
        since = self.way - self.map.experiences["way"][self.active]
        is_earlier = since >= self._config.experiences.min_revisit_distance
        others = [k for k, place in enumerate(self.active) if is_earlier[k] and place != self.place]
        return [*(k for k, place in enumerate(self.active) if place == self.place), *others]

    def check(self, experience: int, offset: Motion) -> None:
        """Verify a known experience that lies far from where the robot is believed to be.

        Two places may share a scene and pose cells. Then the robot seems to visit the other place
        without being re-localised. So if the map puts the experience far from the believed pose,
        it is verified like a re-localisation. If one is pending already, the experience is
        compared with the pending poses before it. If it is far from these, they were false; if it
        is near the pose by odometry from the anchor, nothing is pending.

        Args:
            experience: The experience that the robot is about to enter.
            offset: The robot's pose in its frame by the view.
        """
        verification = self._verification
        if not self._config.experiences.confirmations:
            return
        if verification.anchor < 0:
            if self._is_far(experience, offset, self.believed):
                self.begin_verification()
        elif verification.hypothesis >= 0:
            pose = compose(
                self.map.poses[verification.hypothesis], np.array(verification.from_hypothesis)
            )
            if self._is_far(experience, offset, pose):
                self.begin_verification()
                if not self._is_far(experience, offset, self.believed):
                    verification.reset()

    def _is_far(self, experience: int, offset: Motion, pose: Pose) -> bool:
        """Return whether a pose by a view is outside the zone round another pose in the map."""
        config = self._config.experiences
        x, y, turn = (np.array(offset) - relative(self.map.poses[experience], pose)).tolist()
        return math.hypot(x, y) > config.radius or abs(nearest_turn(turn)) > config.turn

    def smoothed(self, experience: int, offset: Motion) -> tuple[Motion, float]:
        """Return the robot's pose in an experience that it enters, smoothed over those before.

        This is the weighted mean of the pose by the view and the pose by map and odometry. The
        weight of the view falls from 1 at a re-localisation to 1/2, 1/3 and so on, as in a Kalman
        filter whose measurements have equal variances; it falls less where the odometer's bias adds
        much turn in between. While a re-localisation is pending, and if both poses are far apart,
        only the view is believed.

        Args:
            experience: The experience that the robot enters.
            offset: The robot's pose in its frame by the view.

        Returns:
            The pose, and its variance as a share of that of a pose by one scene, which is the
            weight of the view.
        """
        is_pending = self._verification.anchor >= 0 or self._is_far(
            experience, offset, self.believed
        )
        if is_pending or self._weight == 0.0:
            self._weight = 1.0
            return offset, 1.0
        expected = relative(self.map.poses[experience], self.believed)
        x, y, turn = (np.array(offset) - expected).tolist()
        excess = self._bias.rate * (self.stamp - self._left_at)
        variance = self._weight + (excess / SCENE_TURN) ** 2
        self._weight = max(self._config.experiences.smoothing, variance / (1.0 + variance))
        change = np.array((x, y, nearest_turn(turn)))
        return motion_of((expected + self._weight * change).tolist()), self._weight

    def begin_verification(self) -> None:
        """Begin to verify a re-localisation; if one is pending already, go back to its anchor."""
        verification = self._verification
        if self.place < 0 or not self._config.experiences.confirmations:
            return
        if verification.anchor >= 0:
            self.place, self.here = verification.anchor, verification.from_anchor
            self._variance = verification.variance
            self._left_at, self._left_in = verification.left_at, verification.left_in
            self._drop_poses()
        left = self._left_at, self._left_in
        verification.begin(self.place, self.here, self._variance, *left, self.map.count)

    def _drop_poses(self) -> None:
        """Go back to the poses by odometry since the pending re-localisation; see `dropped`."""
        meanwhile = self._verification.meanwhile
        if meanwhile.count:
            self.dropped = meanwhile.rows("anchor").copy(), meanwhile.rows("pose").copy()
            meanwhile.clear()

    def note(self) -> None:
        """Note the robot's pose at a reading, for a re-localisation that is dropped later."""
        self.dropped = None
        self._verification.note()

    def _connect(self, transition: Transition) -> None:
        """Learn a transition."""
        source, target, motion, time, variance, steps = transition
        # With a laser, aligned scans have removed the odometer's bias already.
        bias = self._bias.rate if self._config.sees == "scenes" else 0.0
        if self.map.connect(source, target, motion, time, bias, variance, steps):
            self.updates += 1

    def _restored(self, state: Arrays) -> None:
        self.reading = len(state["history.place"])


@kernel()
def is_any_near(
    poses: np.ndarray, pose: tuple[float, float, float], zone: tuple[float, float]
) -> bool:
    """Return whether any of the poses is in the zone of a pose (m, rad)."""
    for k in range(poses.shape[0]):
        x, y = poses[k, 0] - pose[0], poses[k, 1] - pose[1]
        if x * x + y * y <= zone[0] * zone[0]:
            turn = (poses[k, 2] - pose[2] + math.pi) % (2.0 * math.pi) - math.pi
            if abs(turn) <= zone[1]:
                return True
    return False
