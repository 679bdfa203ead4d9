"""The subjects of the pointing probes: mappers, and models of spatial memory to compare them with.

A mapper remembers a target by its sightings: at which reading it was, and where in the robot's
frame. Where the target is on the map follows from the pose that the mapper believes for that
reading; if it corrects earlier poses (`CorrectedTrajectory`), from the pose as believed when it is
asked. Several sightings are averaged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import CorrectedTrajectory
from albot_core.mappers.registry import check_sensors, make_mapper, mapper_spec
from albot_experiments.pointing_lessons import Lesson, Sighting

TURN_NOISE, MOVE_NOISE = 0.05, 0.05
"""Errors with which a transient vector is updated, of its own for each target: standard deviation
after one radian (rad/√rad) and after one metre (m/√m). Ours: the thesis gives no figures."""
COARSE = 0.6
"""Standard deviation of an enduring place of `switch` in x and in y (m). Ours: the model says that
it is "less precise"."""
PRECISE = 0.5
"""Share of these errors that the transient vectors of `switch` have. Ours: the model says that they
are the more accurate part."""
LOST_AFTER = 4 * np.pi
"""Turn felt without sight after which a subject no longer trusts its transient vectors (rad): two
whole turns. Ours."""
BLUR = 0.1
"""Standard deviation of the errors of `isotropic` in x and in y (m). Ours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Memory:
    """What a subject believes at the end of a phase. Targets never seen are at the origin."""

    places: Float64[np.ndarray, "targets 2"]
    """Where the targets are, in the subject's frame (m): for imagined stands."""
    pose: Pose
    """Where it believes to be, in the same frame."""
    is_known: Bool[np.ndarray, "targets"]
    """Whether each target was ever seen."""
    is_lost: bool = False
    """Whether the subject says that it is lost. It points all the same, by what it believes."""
    vectors: Float64[np.ndarray, "targets 2"] | None = None
    """Vectors to the targets in the robot's frame (m) that it points by; None if it points by the
    places."""

    @property
    def pointed(self) -> Float64[np.ndarray, "targets 2"]:
        """Where each target is now, in the robot's frame (m): for egocentric pointing."""
        if self.vectors is not None:
            return self.vectors
        return transform_points(inverse(self.pose), self.places)


Memories = Mapping[str, Memory]
"""The memory at the end of each phase, by phase."""
Subject = Callable[[Lesson, np.random.Generator], Memories]
"""Goes through a lesson; the generator draws the subject's own errors."""


def places_of(
    sightings: Sequence[Sighting], poses: Poses, count: int
) -> tuple[Float64[np.ndarray, "targets 2"], Bool[np.ndarray, "targets"]]:
    """Return where targets are by their sightings, and which were seen.

    Args:
        sightings: The sightings.
        poses: (readings, 3): the pose at each reading, in the map's frame.
        count: Number of targets.

    Returns:
        The mean place of each target in the map's frame (m), the origin for one never seen; and
        whether each was seen.
    """
    sums, counts = np.zeros((count, 2)), np.zeros(count)
    for each in sightings:
        sums[each.target] += transform_points(poses[each.reading], each.point)
        counts[each.target] += 1
    return sums / np.maximum(counts, 1)[:, None], counts > 0


def mapper_memories(name: str, lesson: Lesson, rng: np.random.Generator) -> Memories:
    """Return what a mapper's map says of the targets.

    Raises:
        InputError: There is no such mapper, or it needs another sensor than laser and compass.
    """
    check_sensors(mapper_spec(name), {"laser", "compass"}, "a pointing probe")
    mapper = make_mapper(name, rng=rng)
    phases = {end: phase for phase, end in lesson.ends.items()}
    believed, memories = [], {}
    for number, reading in enumerate(lesson.readings):
        mapper.update(reading)
        estimate = mapper.estimate
        believed.append(estimate.pose)
        if number not in phases:
            continue
        poses = np.array(believed)
        if isinstance(mapper, CorrectedTrajectory):
            poses = mapper.corrected_poses()
        places, known = places_of(lesson.sightings, poses, len(lesson.targets))
        memories[phases[number]] = Memory(
            places=places, pose=poses[-1], is_known=known, is_lost=not estimate.localised
        )
    return memories


def true_memories(lesson: Lesson, rng: np.random.Generator, blur: float = 0.0) -> Memories:
    """Return the truth: the robot knows its pose, and each target's place to within `blur` (m).

    Without blur it never errs. With it, the errors are alike in all directions, so that only the
    layout of the targets makes one question harder than another. It knows the targets that were
    shown.
    """
    _, known = places_of(lesson.sightings, lesson.truth, len(lesson.targets))
    places = lesson.targets + rng.normal(0.0, blur, lesson.targets.shape)
    places = np.where(known[:, None], places, 0.0)
    return {
        phase: Memory(places=places, pose=lesson.truth[end], is_known=known)
        for phase, end in lesson.ends.items()
    }


def seeing_memories(lesson: Lesson, rng: np.random.Generator) -> Memories:
    """Return the memory of a robot that always knows its pose, and sees targets as all others do.

    What it errs by is the laser's and the beams' part in the errors of every map.
    """
    places, known = places_of(lesson.sightings, lesson.truth, len(lesson.targets))
    return {
        phase: Memory(places=places, pose=lesson.truth[end], is_known=known)
        for phase, end in lesson.ends.items()
    }


class TransientVectors:
    """Egocentric vectors to targets, each updated by itself (thesis, section 2.1.1, figure 2.1b).

    As the robot moves by M, each vector A becomes A' = A - M. Each update has an error of its own,
    because, as Wang and Spelke argue, it "is necessary for all individual objects".

    Args:
        count: Number of targets.
        rng: Draws the errors.
        noise: Share of the usual errors, `TURN_NOISE` and `MOVE_NOISE`.
    """

    def __init__(self, count: int, rng: np.random.Generator, noise: float = 1.0) -> None:
        self.vectors = np.zeros((count, 2))
        """Where each target is, in the robot's frame (m)."""
        self.is_known = np.zeros(count, np.bool_)
        """Whether each was ever seen."""
        self._rng, self._noise = rng, noise

    def move(self, motion: Pose) -> None:
        """Update the vectors after a motion as the robot feels it."""
        moved = transform_points(inverse(motion), self.vectors)
        travel, turn = float(np.hypot(*motion[:2])), abs(float(motion[2]))
        shape = self.vectors.shape
        moved = moved + self._rng.normal(0.0, self._noise * MOVE_NOISE * np.sqrt(travel), shape)
        angles = self._rng.normal(0.0, self._noise * TURN_NOISE * np.sqrt(turn), len(moved))
        cos, sin = np.cos(angles), np.sin(angles)
        x, y = moved.T
        turned = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)
        self.vectors = np.where(self.is_known[:, None], turned, 0.0)

    def see(self, sighting: Sighting) -> None:
        """Put a vector right by what is seen."""
        self.vectors[sighting.target] = sighting.point
        self.is_known[sighting.target] = True


def _live(lesson: Lesson, transient: TransientVectors) -> Iterator[tuple[str, float]]:
    """Take transient vectors through a lesson.

    Yields each phase at its end, and the turn felt since the last sight of a target, while the
    robot was blind (rad).
    """
    sightings: dict[int, list[Sighting]] = {}
    for sighting in lesson.sightings:
        sightings.setdefault(sighting.reading, []).append(sighting)
    phases = {end: phase for phase, end in lesson.ends.items()}
    felt = 0.0
    for number, reading in enumerate(lesson.readings):
        if number:
            transient.move(reading.motion)
        seen = sightings.get(number, ())
        for sighting in seen:
            transient.see(sighting)
        if seen:
            felt = 0.0
        elif not np.isfinite(reading.required_laser("a subject").ranges).any():
            felt += abs(float(reading.motion[2]))
        if number in phases:
            yield phases[number], felt


def egocentric_memories(lesson: Lesson, rng: np.random.Generator, noise: float = 1.0) -> Memories:
    """Return the memory of Wang and Spelke's model: transient vectors and nothing else.

    Args:
        lesson: The lesson.
        rng: Draws the vectors' errors.
        noise: See `TransientVectors`.
    """
    transient = TransientVectors(len(lesson.targets), rng, noise)
    return {
        phase: Memory(
            places=transient.vectors,
            pose=np.zeros(3),
            is_known=transient.is_known.copy(),
            vectors=transient.vectors,
        )
        for phase, _ in _live(lesson, transient)
    }


def switching_memories(
    lesson: Lesson, rng: np.random.Generator, lost_after: float = LOST_AFTER
) -> Memories:
    """Return the memory of Waller and Hodgson's model (thesis, section 2.1.2): both, and a switch.

    It points by its transient vectors until it has felt itself turned `lost_after` (rad) without
    sight, and from then on by an enduring, less precise map, by which it also imagines stands. The
    map is that of `odometry`, each place blurred by `COARSE`.
    """
    maps = mapper_memories("odometry", lesson, rng)
    blur = rng.normal(0.0, COARSE, lesson.targets.shape)
    transient = TransientVectors(len(lesson.targets), rng, PRECISE)
    memories = {}
    for phase, felt in _live(lesson, transient):
        known = maps[phase].is_known
        memories[phase] = replace(
            maps[phase],
            places=np.where(known[:, None], maps[phase].places + blur, 0.0),
            vectors=None if felt > lost_after else transient.vectors,
        )
    return memories


TRUTH, ISOTROPIC, SEEING = "truth", "isotropic", "true-poses"
"""The truth; the truth with errors alike in all directions; the truth of the poses alone."""
EGOCENTRIC, SWITCH = "egocentric", "switch"
"""Wang and Spelke's model, and Waller and Hodgson's."""
MAPPERS = (
    "odometry", "albot1-thesis", "albot1", "association", "ratslam", "hssh", "sahabot",
    "scan-matching", "graph-slam",
)  # fmt: skip
"""The mappers that are asked."""
SUBJECTS: Mapping[str, Subject] = {
    TRUTH: true_memories,
    ISOTROPIC: partial(true_memories, blur=BLUR),
    SEEING: seeing_memories,
    EGOCENTRIC: egocentric_memories,
    SWITCH: switching_memories,
    **{name: partial(mapper_memories, name) for name in MAPPERS},
}
"""The subjects by name: first the models to compare with, then the mappers."""


def memories_of(lesson: Lesson, seed: int, subjects: Mapping[str, Subject]) -> dict[str, Memories]:
    """Return the memories of subjects that go through the same lesson, each with its own errors."""
    return {
        name: subject(lesson, np.random.default_rng((seed, 2)))
        for name, subject in subjects.items()
    }
