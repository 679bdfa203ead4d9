"""Algorithm 4 end to end on a tiny room, and the laws that every mapper keeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_segments
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.mapper import Mapper
from albot_core.sensing.reading import LaserGeometry, Reading
from tests.core.scenes import FURNITURE, ROOM, house_walk, scan_from, two_rooms

RNG = np.random.default_rng(0)

PRESETS = [Albot1, Albot1.thesis]
EVERY_READING = {"view_spacing": 0.0, "view_turn": 0.0}
"""Fields of a config by which every reading is a view."""


def walk(steps: int = 40) -> np.ndarray:
    """A walk around in the room, from its middle along a circle."""
    angles = np.linspace(0, 2 * np.pi, steps)
    radius = 1.5
    return np.stack((radius * np.sin(angles), radius * (1 - np.cos(angles)), angles), -1)


def readings(
    path: np.ndarray,
    walls: np.ndarray = ROOM,
    error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise: float = 0.0,
    seed: int = 0,
) -> list[Reading]:
    rng = np.random.default_rng(seed)
    made = []
    for i, pose in enumerate(path):
        motion = relative(path[max(i - 1, 0)], pose) + (np.array(error) if i else 0.0)
        scan = scan_from(pose, walls)
        scan.ranges[:] += rng.normal(0.0, noise, len(scan.ranges)) if noise else 0.0
        made.append(Reading(stamp=float(i), motion=motion, laser=scan))
    return made


def run(mapper: Albot1, readings: list[Reading]) -> np.ndarray:
    poses = []
    for reading in readings:
        mapper.update(reading)
        poses.append(mapper.estimate.pose)
    return np.array(poses)


@pytest.mark.parametrize("make", PRESETS)
def test_it_is_a_mapper(make: type[Albot1]) -> None:
    mapper = make()
    assert isinstance(mapper, Mapper)
    assert mapper.updates == 0
    assert mapper.snapshot().segments.shape == (0, 4)


@pytest.mark.parametrize("make", PRESETS)
def test_perfect_readings_give_the_true_poses(make: type[Albot1]) -> None:
    path = walk()
    poses = run(mapper := make(), readings(path))
    truth = np.array([relative(path[0], pose) for pose in path])
    # The letter lays surfaces from first to last point, which turns them by up to a beam.
    assert np.abs(poses[:, :2] - truth[:, :2]).max() < (0.02 if make == Albot1 else 0.25)
    assert 1 < mapper.updates < len(path)


def test_the_default_corrects_an_odometer_that_turns_wrongly() -> None:
    path = walk()
    wrong = readings(path, error=(0.02, 0.0, np.radians(8.0)), noise=0.01)
    poses = run(mapper := Albot1(), wrong)
    truth = relative(path[0], path[-1])
    assert np.hypot(*(poses[-1] - truth)[:2]) < 0.15
    assert mapper.lost == 0
    assert mapper.estimate.localised
    # The letter cannot: its 5 degrees are less than the odometer's error.
    letter = run(thesis := Albot1.thesis(), wrong)
    assert np.hypot(*(letter[-1] - truth)[:2]) > 0.5
    assert thesis.lost > 20


def test_surfaces_lie_on_the_walls() -> None:
    run(mapper := Albot1(), readings(walk(), noise=0.01))
    assert len(mapper.snapshot().segments) >= 10
    for x1, y1, x2, y2 in mapper.snapshot().segments:
        middle = np.array([(x1 + x2) / 2, (y1 + y2) / 2])
        start, along = ROOM[:, :2], ROOM[:, 2:] - ROOM[:, :2]
        share = np.clip(((middle - start) * along).sum(1) / (along**2).sum(1), 0, 1)
        assert np.hypot(*(start + share[:, None] * along - middle).T).min() < 0.12


@pytest.mark.parametrize("make", PRESETS)
def test_moving_the_whole_world_changes_nothing(make: type[Albot1]) -> None:
    motion = np.array([13.0, -7.0, 1.1])
    path = walk(20)
    here, there = make(), make()
    run(here, readings(path))
    run(there, readings(compose(motion, path), transform_segments(motion, ROOM)))
    assert here.snapshot().segments.shape == there.snapshot().segments.shape
    assert np.allclose(here.snapshot().segments, there.snapshot().segments, atol=1e-6)


@pytest.mark.parametrize("make", PRESETS)
def test_the_same_readings_give_the_same_bits(make: type[Albot1]) -> None:
    given = readings(walk(), noise=0.01)
    one, other = make(), make()
    assert np.array_equal(run(one, given), run(other, given))
    assert np.array_equal(one.snapshot().segments, other.snapshot().segments)
    one.reset(RNG)
    assert one.snapshot().segments.shape == (0, 4)
    assert np.array_equal(run(one, given), run(other := make(), given))
    assert np.array_equal(one.snapshot().segments, other.snapshot().segments)


@pytest.mark.parametrize("make", PRESETS)
@pytest.mark.parametrize("cut", [1, 7, 20])
def test_a_restored_mapper_goes_on_as_if_never_stopped(make: type[Albot1], cut: int) -> None:
    given = readings(walk(), noise=0.01)
    whole = run(never_stopped := make(), given)
    first = make()
    run(first, given[:cut])
    second = make()
    second.restore(first.state())
    assert np.array_equal(second.estimate.pose, whole[cut - 1])
    assert np.array_equal(run(second, given[cut:]), whole[cut:])
    assert np.array_equal(second.snapshot().segments, never_stopped.snapshot().segments)
    assert second.updates == never_stopped.updates


def test_the_state_shares_no_memory() -> None:
    run(mapper := Albot1(), readings(walk(10)))
    before = mapper.snapshot().segments
    for array in mapper.state().values():
        array[...] = 0
    assert np.array_equal(mapper.snapshot().segments, before)


def test_a_contradictory_state_is_refused_and_nothing_is_lost() -> None:
    run(mapper := Albot1(), readings(walk(10)))
    state, before = mapper.state(), mapper.snapshot().segments
    state["view.slots"][0] = 10**9
    with pytest.raises(InputError, match="slots"):
        mapper.restore(state)
    assert np.array_equal(mapper.snapshot().segments, before)


def test_in_the_dark_path_integration_stands_in() -> None:
    dark = np.zeros((0, 4))
    path = walk(10)
    poses = run(mapper := Albot1(), readings(path, dark))
    assert np.allclose(poses[-1], relative(path[0], path[-1]))
    assert mapper.lost == 9
    assert np.allclose(
        compose(mapper.estimate.pose, mapper.estimate.home_from_robot), np.zeros(3), atol=1e-12
    )


def test_a_bare_corridor_is_followed_by_its_walls() -> None:
    # Two side walls only: no landmark, so the way along is the odometer's, but the
    # default still keeps to the middle and to the heading by the walls' lines.
    corridor = np.array([[-50.0, -1.0, 50.0, -1.0], [-50.0, 1.0, 50.0, 1.0]])
    path = np.zeros((15, 3))
    path[:, 0] = np.arange(15) * 0.5
    poses = run(mapper := Albot1(), readings(path, corridor, error=(0.0, 0.02, 0.05)))
    assert np.abs(poses[-1, 1:]).max() < 0.05
    assert mapper.lost == 14


@pytest.mark.parametrize("make", PRESETS)
def test_a_reading_near_the_last_view_only_moves_the_robot(make: type[Albot1]) -> None:
    config = make().config
    spaced = Albot1(replace(config, view_spacing=0.5, view_turn=np.radians(12.0)))
    seldom = Albot1(replace(config, **EVERY_READING))
    last, since, views = np.zeros(3), np.zeros(3), 0
    for reading in readings(walk(120), noise=0.01, error=(0.002, 0.0, 0.003)):
        since = compose(since, reading.motion) if views else since
        laid = spaced.update(reading)
        is_first_motion = views == 1 and config.submap_matching
        is_far = np.hypot(*since[:2]) >= 0.5 or abs(since[2]) >= np.radians(12.0)
        if views == 0 or is_first_motion or is_far:
            # What the mapper makes of a view is what one does that is given the views alone.
            view = Reading(stamp=reading.stamp, motion=since, laser=reading.laser)
            assert seldom.update(view) is laid
            last, since, views = seldom.estimate.pose, np.zeros(3), views + 1
        assert not (since.any() and laid)
        np.testing.assert_allclose(spaced.estimate.pose, compose(last, since), atol=1e-9)
        np.testing.assert_allclose(
            spaced.snapshot().segments, seldom.snapshot().segments, atol=1e-9
        )
    assert 20 < views < 80
    assert spaced.updates == seldom.updates > 1
    assert spaced.lost == seldom.lost


@pytest.mark.parametrize("spacing", [(0.0, 1.0), (1.0, 0.0)])
def test_with_either_spacing_zero_every_reading_is_a_view(spacing: tuple[float, float]) -> None:
    config = replace(
        Albot1Config.thesis(), submap_matching=True, view_spacing=spacing[0], view_turn=spacing[1]
    )
    one, other = Albot1(config), Albot1(replace(Albot1Config.thesis(), submap_matching=True))
    given = readings(walk(20), noise=0.01)
    assert np.array_equal(run(one, given), run(other, given))


def test_lasers_may_differ_from_reading_to_reading() -> None:
    fine = LaserGeometry(beams=361, spacing=np.radians(0.5))
    path = walk(10)
    mapper = Albot1()
    for i, pose in enumerate(path):
        scan = scan_from(pose, ROOM, fine if i % 2 else LaserGeometry())
        motion = relative(path[max(i - 1, 0)], pose)
        mapper.update(Reading(stamp=float(i), motion=motion, laser=scan))
    assert np.hypot(*(mapper.estimate.pose - relative(path[0], path[-1]))[:2]) < 0.05


@pytest.mark.parametrize(
    "wrong",
    [
        {"landmark_gap": 0.0},
        {"min_landmarks": 0},
        {"margin": -0.1},
        {"match_range": np.nan},
        {"view_turn": -0.1},
        {"turn_search": -0.1},
        {"turn_search": 50.0},
    ],
)
def test_impossible_thresholds_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        Albot1Config(**wrong)  # type: ignore[arg-type]


BIAS = np.array((0.0, 0.0, 0.003))


def carried(seed: int) -> list[Reading]:
    """A walk through two rooms in small steps; once the robot is carried elsewhere."""
    path, house = house_walk(), np.concatenate((two_rooms(), FURNITURE))
    steps = relative(path[:-1], path[1:])
    parts = [compose(path[:-1], share * steps) for share in (0.0, 0.25, 0.5, 0.75)]
    fine = np.concatenate(parts, axis=1).reshape(-1, 3)
    rng, at, given = np.random.default_rng(seed), 0, []
    for k in range(300):
        before, at = at, (at + 1) % len(fine)
        motion = relative(fine[before], fine[at])
        if k == 150:
            at, motion = int(rng.integers(len(fine))), np.zeros(3)
        scan = scan_from(fine[at], house)
        given.append(Reading(stamp=float(k), motion=motion + BIAS, laser=scan))
    return given


@pytest.mark.parametrize("seed", [0, 3])
def test_a_lost_robot_finds_its_way_by_its_views_alone(seed: int) -> None:
    spaced, seldom = Albot1(), Albot1(replace(Albot1Config(), **EVERY_READING))
    since, views, lost = np.zeros(3), 0, 0
    for k, reading in enumerate(carried(seed)):
        since = compose(since, reading.motion) if k else since
        spaced.update(reading)
        if spaced.state()["progress"][0] > views:
            seldom.update(Reading(stamp=reading.stamp, motion=since, laser=reading.laser))
            since, views = np.zeros(3), views + 1
        histories = [
            [(e.step, e.kind, e.place, e.other) for e in m.events] for m in (spaced, seldom)
        ]
        assert histories[0] == histories[1]
        assert (not spaced.estimate.localised) == (not seldom.estimate.localised)
        np.testing.assert_allclose(
            spaced.estimate.pose, compose(seldom.estimate.pose, since), atol=1e-9
        )
        lost += not spaced.estimate.localised
    assert lost > 0 and views < 150
