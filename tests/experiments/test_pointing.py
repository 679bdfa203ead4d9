"""Probes that ask mappers: measures in closed form, memories, and verdicts that turn red."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, transform_points
from albot_core.mappers.mapper import CorrectedTrajectory, require
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_experiments import pointing_errors as measures
from albot_experiments import pointing_subjects, probe_axes, probe_jrd, probe_pointing
from albot_experiments.pointing_lessons import (
    CLOSED,
    OPEN,
    PHASES,
    TURNED,
    Lesson,
    sightings_of,
    teach,
)
from albot_experiments.pointing_scenes import array, chamber, corner_room
from albot_experiments.pointing_subjects import (
    Memories,
    Memory,
    TransientVectors,
    egocentric_memories,
    mapper_memories,
    memories_of,
    places_of,
    switching_memories,
    true_memories,
)
from albot_experiments.probe_axes import ALONG, AXIS, LEARNT
from albot_experiments.probe_jrd import ORDER, RISE, STAY
from albot_experiments.probe_pointing import CORNERS, OBJECTS
from albot_experiments.registry import EXPERIMENTS

SQUARE = np.array(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)))
ALL = np.ones(4, np.bool_)


# Measures


def test_a_turned_robot_errs_by_its_turn_alone() -> None:
    """Its errors all are the turn: the heading error is the turn, the configuration error 0."""
    for turn in (0.3, -2.0, math.pi - 0.01):
        errors = measures.pointing_errors(SQUARE, ALL, np.array((0.0, 0.0, turn)), SQUARE)
        assert measures.heading_error(errors) == pytest.approx(turn)
        assert measures.configuration_error(errors) == pytest.approx(0.0, abs=1e-9)


def test_configuration_error_in_closed_form() -> None:
    """Of errors +a, -a, +a, -a around a mean of pi it is a, across the wrap."""
    errors = np.array((math.pi - 0.2, math.pi + 0.2 - 2 * math.pi) * 2)
    assert abs(measures.heading_error(errors)) == pytest.approx(math.pi)
    assert measures.configuration_error(errors) == pytest.approx(0.2)


def test_pointing_by_chance_has_the_error_of_all_directions() -> None:
    errors = np.random.default_rng(0).uniform(-np.pi, np.pi, 100_000)
    assert np.degrees(measures.configuration_error(errors)) == pytest.approx(104, abs=1)


def test_a_judgement_in_closed_form() -> None:
    """At the origin, facing (1, 0), (0, 1) is 90° to the left; believed at (1, 1) it is 45°."""
    true = np.array(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    believed = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    errors = measures.jrd_errors(believed, true, np.array(((0, 1, 2),)))
    np.testing.assert_allclose(np.degrees(errors), (-45.0,))


@given(
    places=arrays(np.float64, (5, 2), elements=st.floats(-9, 9), unique=True),
    frame=arrays(np.float64, 3, elements=st.floats(-3, 3)),
)
def test_judgements_do_not_depend_on_the_frame(places: np.ndarray, frame: np.ndarray) -> None:
    triads = measures.triads_of(np.ones(5, np.bool_))
    errors = measures.jrd_errors(transform_points(frame, places), places, triads)
    apart = [np.hypot(*(places[b] - places[a])) for a, b in triads[:, :2]]
    far = np.array(apart) > 1e-3
    far &= np.hypot(*(places[triads[:, 2]] - places[triads[:, 0]]).T) > 1e-3
    np.testing.assert_allclose(errors[far], 0.0, atol=1e-6)


@given(st.lists(st.floats(-20, 20), min_size=1, max_size=9))
def test_measures_are_never_nan(values: list[float]) -> None:
    errors = np.array(values)
    assert math.isfinite(measures.heading_error(errors))
    assert 0.0 <= measures.configuration_error(errors) <= math.pi


def test_no_direction_counts_as_chance() -> None:
    at_me = np.zeros((4, 2))
    errors = measures.pointing_errors(at_me, ALL, np.zeros(3), SQUARE)
    np.testing.assert_allclose(errors, math.pi / 2)
    triads = measures.triads_of(ALL)
    np.testing.assert_allclose(measures.jrd_errors(at_me, SQUARE, triads), math.pi / 2)


def test_effects_of_nobody_are_unknown_and_predict_nothing() -> None:
    assert measures.Effect.of([]) is None and measures.told(None) is None
    assert not measures.rises(None) and not measures.stays(None)
    assert not len(measures.triads_of(np.array((True, True, False))))
    same = measures.Effect.of(np.radians((3.0, 3.0, 3.0)).tolist())
    assert str(same) == "3.0 (3.0 to 3.0)" and measures.rises(same) and not measures.stays(same)
    assert str(measures.Effect(mean=-0.01, low=-0.04, high=0.0)) == "0.0 (0.0 to 0.0)"


# Lessons


@pytest.fixture(scope="module")
def lessons() -> list[Lesson]:
    return [teach(chamber(), seed) for seed in range(500, 510)]


@pytest.fixture(scope="module")
def corner_lessons() -> list[Lesson]:
    return [teach(corner_room(), seed) for seed in range(500, 510)]


def test_the_robot_is_blind_and_turned_round_as_told(lessons: list[Lesson]) -> None:
    lesson = lessons[0]
    assert tuple(lesson.ends) == PHASES
    assert lesson.ends[PHASES[-1]] == len(lesson.readings) - 1 == len(lesson.truth) - 1
    blind = slice(lesson.ends[OPEN] + 1, lesson.ends[TURNED] + 1)
    for reading in lesson.readings[blind]:
        assert reading.laser is not None and not np.isfinite(reading.laser.ranges).any()
        assert reading.compass == lesson.readings[lesson.ends[OPEN]].compass
    seen = lesson.readings[-1].laser
    assert seen is not None and np.isfinite(seen.ranges).sum() > 150
    np.testing.assert_allclose(lesson.truth[blind, :2], 0.0, atol=0.2)  # It stays in the middle.
    felt = sum(float(each.motion[2]) for each in lesson.readings[blind])
    turned = np.diff(np.unwrap(lesson.truth[lesson.ends[OPEN] : blind.stop, 2])).sum()
    assert abs(felt - turned) > math.radians(10)
    again = teach(chamber(), 500)
    np.testing.assert_array_equal(again.truth, lesson.truth)


def test_targets_are_seen_where_they_are_and_never_through_walls(lessons: list[Lesson]) -> None:
    scene, lesson = chamber(), lessons[0]
    assert {each.target for each in lesson.sightings} == set(range(6))
    for each in lesson.sightings:
        at = transform_points(lesson.truth[each.reading], each.point)
        assert np.hypot(*(at - lesson.targets[each.target])) < 0.15
        assert np.hypot(*lesson.truth[each.reading, :2]) > 1.0  # Not from inside the chamber.
    far = replace(scene, near=9.0)
    assert not sightings_of(far, 0, lesson.readings[0], lesson.truth[0])


def test_questions_of_all_headings_are_equally_hard_by_layout() -> None:
    for scene in (array(), array(across=True)):
        asked = probe_axes.questions(scene.targets)
        assert [len(each) for each in asked] == [14] * 8
        for triads in asked:
            apart = scene.targets[triads[:, 1]] - scene.targets[triads[:, 0]]
            np.testing.assert_allclose(np.hypot(*apart.T), 1.5)


# Memories

ASKED = [
    name
    for name in pointing_subjects.SUBJECTS
    if name not in pointing_subjects.MAPPERS or name in installed_mappers()
]


def test_sightings_are_averaged_and_a_target_never_seen_is_unknown(lessons: list[Lesson]) -> None:
    lesson = lessons[0]
    one = lesson.sightings[0]
    twice = [replace(one, target=0, reading=0), replace(one, target=0, reading=1)]
    poses = np.array(((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)))
    places, known = places_of(twice, poses, 3)
    np.testing.assert_allclose(places, (one.point + np.array((1.0, 0.0)), (0.0, 0.0), (0.0, 0.0)))
    assert known.tolist() == [True, False, False]


def test_noiseless_vectors_are_the_truth(lessons: list[Lesson]) -> None:
    """With true motions and no errors each vector stays where its target is (figure 2.1b)."""
    vectors = TransientVectors(1, np.random.default_rng(0), noise=0.0)
    vectors.see(replace(lessons[0].sightings[0], target=0, point=np.array((1.0, 0.0))))
    pose = np.zeros(3)
    for motion in np.array(((0.5, 0.1, 1.0), (0.0, 0.0, -2.0), (1.0, 0.0, 0.3))):
        vectors.move(motion)
        pose = compose(pose, motion)
    np.testing.assert_allclose(transform_points(pose, vectors.vectors), ((1.0, 0.0),), atol=1e-12)


@pytest.mark.parametrize("name", ASKED)
def test_every_subject_remembers_all_targets_and_is_finite(
    name: str, lessons: list[Lesson]
) -> None:
    subject = pointing_subjects.SUBJECTS[name]
    memories = memories_of(lessons[0], 500, {name: subject})[name]
    assert tuple(memories) == PHASES
    for memory in memories.values():
        assert memory.is_known.all()
        assert np.isfinite(memory.pointed).all() and np.isfinite(memory.places).all()


@pytest.mark.parametrize("name", ["odometry", "egocentric", "switch", "ratslam", "true-poses"])
def test_a_target_never_seen_is_left_out(name: str, lessons: list[Lesson]) -> None:
    lesson = lessons[0]
    seen = tuple(each for each in lesson.sightings if each.target == 2)
    fewer = replace(lesson, sightings=seen)
    memories = memories_of(fewer, 500, {name: pointing_subjects.SUBJECTS[name]})[name]
    assert memories[TURNED].is_known.tolist() == [k == 2 for k in range(6)]
    pointing, judging, axes = probe_pointing.Answers(), probe_jrd.Answers(), probe_axes.Answers()
    pointing.add(fewer, memories)
    judging.add(fewer, memories)
    axes.add(fewer, memories[OPEN])
    rows = (
        pointing.figures(OBJECTS), judging.figures(), axes.figures(ALONG, probe_axes.Answers()),
    )  # fmt: skip
    for row in rows:
        assert 0 in row.values()  # Lessons.
        assert not any(isinstance(cell, float) and math.isnan(cell) for cell in row.values())
        assert True not in [cell for cell in row.values() if isinstance(cell, bool)]
    nothing = replace(lesson, sightings=())
    for memory in memories_of(nothing, 500, {name: pointing_subjects.SUBJECTS[name]})[
        name
    ].values():
        assert np.isfinite(memory.pointed).all() and not memory.is_known.any()


def test_targets_move_with_the_trajectory_that_a_mapper_corrects(lessons: list[Lesson]) -> None:
    lesson, name = lessons[1], "ratslam"
    memory = mapper_memories(name, lesson, np.random.default_rng(0))[PHASES[-1]]
    mapper, believed = make_mapper(name, rng=np.random.default_rng(0)), []
    for reading in lesson.readings:
        mapper.update(reading)
        believed.append(mapper.estimate.pose)
    corrected = require(mapper, CorrectedTrajectory).corrected_poses()
    places, _ = places_of(lesson.sightings, corrected, 6)
    np.testing.assert_array_equal(memory.places, places)
    np.testing.assert_array_equal(memory.pose, corrected[-1])
    frozen, _ = places_of(lesson.sightings, np.array(believed), 6)
    assert np.hypot(*(places - frozen).T).max() > 0.01


def test_a_mapper_that_cannot_be_asked_is_refused(lessons: list[Lesson]) -> None:
    with pytest.raises(InputError, match=r"a pointing probe, mapper: .* albot0, which needs sonar"):
        mapper_memories("albot0", lessons[0], np.random.default_rng(0))


# Verdicts

Subject = Callable[[Lesson, np.random.Generator], Memories]


def pointing(subject: Subject, lessons: list[Lesson]) -> probe_pointing.Answers:
    """The answers of one subject in lessons of seeds from 500 on."""
    answers = {"x": probe_pointing.Answers()}
    for seed, lesson in enumerate(lessons, start=500):
        probe_pointing.ask(lesson, seed, {"x": subject}, answers)
    return answers["x"]


def judging(subject: Subject, lessons: list[Lesson]) -> probe_jrd.Answers:
    """The same with judgements of relative direction."""
    answers = probe_jrd.Answers()
    for seed, lesson in enumerate(lessons, start=500):
        answers.add(lesson, memories_of(lesson, seed, {"x": subject})["x"])
    return answers


ODOMETRY = partial(mapper_memories, "odometry")


def shuffled(subject: Subject, lesson: Lesson, rng: np.random.Generator, after: str) -> Memories:
    """The subject, which confuses its targets from a phase on."""
    memories = subject(lesson, rng)
    order = np.roll(np.arange(len(lesson.targets)), 1)
    first = PHASES.index(after)

    def confused(memory: Memory) -> Memory:
        vectors = None if memory.vectors is None else memory.vectors[order]
        return replace(memory, places=memory.places[order], vectors=vectors)

    return {
        phase: confused(memory) if PHASES.index(phase) >= first else memory
        for phase, memory in memories.items()
    }


def test_one_frame_for_all_predicts_the_corners_and_not_the_objects(
    lessons: list[Lesson], corner_lessons: list[Lesson]
) -> None:
    for name in ("odometry", "albot1", "ratslam"):
        subject = pointing_subjects.SUBJECTS[name]
        assert pointing(subject, corner_lessons).predicts(CORNERS)
        assert not pointing(subject, lessons).predicts(OBJECTS)


def test_vectors_of_their_own_predict_the_objects_and_not_the_corners(
    lessons: list[Lesson], corner_lessons: list[Lesson]
) -> None:
    assert pointing(egocentric_memories, lessons).predicts(OBJECTS)
    assert not pointing(egocentric_memories, corner_lessons).predicts(CORNERS)


def test_vectors_without_errors_of_their_own_do_not(lessons: list[Lesson]) -> None:
    exact = partial(egocentric_memories, noise=0.0)
    assert not pointing(exact, lessons).predicts(OBJECTS)


def test_confused_targets_turn_the_corners_red(corner_lessons: list[Lesson]) -> None:
    for after in (OPEN, TURNED):
        broken = partial(shuffled, ODOMETRY, after=after)
        assert not pointing(broken, corner_lessons).predicts(CORNERS)


def test_without_disorientation_nothing_is_tested() -> None:
    """Wheels that do not slip: the robot still knows its heading after eight turns."""
    for scene, targets in ((chamber(), OBJECTS), (corner_room(), CORNERS)):
        control = [teach(scene, seed, disorients=False) for seed in range(500, 503)]
        answers = pointing(ODOMETRY, control)
        assert not answers.is_tested and not answers.predicts(targets)
    assert not pointing(true_memories, control).is_tested


def test_the_switch_predicts_all_three_and_maps_one(lessons: list[Lesson]) -> None:
    model, maps = judging(switching_memories, lessons), judging(ODOMETRY, lessons)
    assert [model.predicts(result) for result in (RISE, STAY, ORDER)] == [True, True, True]
    assert [maps.predicts(result) for result in (RISE, STAY, ORDER)] == [False, True, False]


def test_without_its_switch_the_model_does_not(lessons: list[Lesson]) -> None:
    stuck = judging(partial(switching_memories, lost_after=math.inf), lessons)
    assert not np.isclose(
        stuck.pointing.configuration[TURNED],
        judging(switching_memories, lessons).pointing.configuration[TURNED],
    ).any()
    always = judging(partial(switching_memories, lost_after=-1.0), lessons)
    assert not always.predicts(RISE)


def test_confused_targets_turn_judgements_red(lessons: list[Lesson]) -> None:
    assert not judging(partial(shuffled, ODOMETRY, after=TURNED), lessons).predicts(STAY)
    assert not judging(partial(shuffled, ODOMETRY, after=CLOSED), lessons).predicts(ORDER)


def axes_of(errors: dict[int, float]) -> probe_axes.Answers:
    """Answers with these mean errors by heading, else 2°, in five lessons."""
    row = np.radians([errors.get(heading, 2.0) for heading in probe_axes.HEADINGS])
    return probe_axes.Answers(errors=[row] * 5)


def test_contrasts_in_closed_form() -> None:
    answers = axes_of({0: 1.0, 180: 1.0})  # The mean is 1.75°.
    seeing = axes_of(dict.fromkeys(probe_axes.HEADINGS, 0.1))
    contrasts = {name: each.mean for name, each in answers.contrasts(ALONG, seeing).items() if each}
    assert contrasts[AXIS] == pytest.approx(100 * 1 / 1.75)
    assert contrasts[LEARNT] == pytest.approx(100 * 1 / 1.75)
    across = answers.contrasts(probe_axes.ACROSS, seeing)[LEARNT]
    assert across is not None and across.mean == pytest.approx(-100 * 1 / 1.75)
    assert answers.predicts(AXIS, seeing)
    assert not axes_of({}).predicts(AXIS, seeing)  # Alike in all directions.
    assert not answers.predicts(AXIS, answers)  # It comes from seeing alone.
    never = axes_of(dict.fromkeys(probe_axes.HEADINGS, 0.0))
    of_truth = never.contrasts(ALONG, never).values()
    assert all(each is not None and each.mean == 0.0 for each in of_truth)


def test_the_axis_of_path_integration_turns_with_the_lanes() -> None:
    """Drift makes errors across the lanes larger; where the map is put right, the axis is gone."""
    subjects = {"odometry": ODOMETRY, "true-poses": pointing_subjects.seeing_memories}
    for lanes in (ALONG, probe_axes.ACROSS):
        asked = {name: probe_axes.Answers() for name in subjects}
        for seed in range(500, 508):
            lesson = teach(array(across=lanes == probe_axes.ACROSS), seed)
            for name, memories in memories_of(lesson, seed, subjects).items():
                asked[name].add(lesson, memories[OPEN])
        learnt = asked["odometry"].contrasts(lanes, asked["true-poses"])[LEARNT]
        assert learnt is not None and learnt.low > 5.0
        is_predicted = asked["odometry"].predicts(AXIS, asked["true-poses"])
        assert is_predicted == (lanes == ALONG)
        assert not asked["true-poses"].predicts(AXIS, asked["true-poses"])


def test_a_map_of_scans_that_are_not_seen_has_the_axis_of_its_wheels() -> None:
    """Scans keep the poses right; without them the mapper is path integration, axis and all."""
    scans, blind = probe_axes.Answers(), probe_axes.Answers()
    seeing = probe_axes.Answers()
    matching = partial(mapper_memories, "scan-matching")
    for seed in range(500, 508):
        lesson = teach(array(), seed)
        readings = [lesson.readings[0]]
        for reading in lesson.readings[1:]:
            laser = reading.required_laser("the test")
            dark = replace(laser, ranges=np.full_like(laser.ranges, np.inf))
            readings.append(replace(reading, laser=dark))
        rng = np.random.default_rng(0)
        seeing.add(lesson, pointing_subjects.seeing_memories(lesson, rng)[OPEN])
        scans.add(lesson, matching(lesson, rng)[OPEN])
        blind.add(lesson, matching(replace(lesson, readings=tuple(readings)), rng)[OPEN])
    assert np.mean(blind.errors) > 5 * np.mean(scans.errors)
    assert blind.predicts(AXIS, seeing) and not scans.predicts(AXIS, seeing)


@pytest.mark.parametrize("name", ["probe-pointing", "probe-jrd", "probe-axes"])
def test_the_experiment_runs_and_is_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {
        each: subject
        for each, subject in pointing_subjects.SUBJECTS.items()
        if each in (*pointing_subjects.SUBJECTS,)[:5] or each in ("odometry", "albot1-thesis")
    }
    module = {"probe-pointing": probe_pointing, "probe-jrd": probe_jrd, "probe-axes": probe_axes}
    monkeypatch.setattr(module[name], "SUBJECTS", few)
    judged = tuple(each for each in module[name].JUDGED if each in few)
    monkeypatch.setattr(module[name], "JUDGED", judged)
    monkeypatch.setattr(
        probe_axes, "DRAWN", {each: c for each, c in probe_axes.DRAWN.items() if each in few}
    )
    done: list[int] = []
    report = EXPERIMENTS[name].run(range(500, 502), done.append)
    assert done == [1, 2] and report.id == name and set(report.verdicts)
    paths = report.write(tmp_path)
    assert paths[-1].suffix == ".png" and "nan" not in (tmp_path / "report.md").read_text()
    with pytest.raises(InputError, match="at least one"):
        EXPERIMENTS[name].run(range(0), done.append)
