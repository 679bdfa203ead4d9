"""What the robot remembers of obstacles: a door seen shut stays shut until a beam passes it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import pseudo_angle
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_builder import ObservationBuilder
from albot_env.tasks.core.obstacle_kernels import CELL, SEEN
from albot_env.tasks.core.parts.map_patch import MAP_PATCH, MapPatchConfig
from albot_maps import World
from tests.env.tasks.test_map_patch import believed

LASER = LaserGeometry()
SENSOR = CoverageConfig().sensor(LASER)
CONFIG = ObservationConfig(
    parts=("map_patch",),
    map_patch=MapPatchConfig(
        sides=(8.0,), cells=16, channels=("obstacles",), obstacle_memory=3.0, obstacle_range=4.0
    ),
).fitted(LASER, None, None)
BEARINGS = LASER.mount[2] + LASER.first_bearing + LASER.spacing * np.arange(LASER.beams)


class Robot:
    """A robot that moves and sees as it is told."""

    def __init__(self, world: World) -> None:
        self.builder = ObservationBuilder(1, CONFIG, LASER, 0.25, None)
        self.builder.begin(0, world)
        self.state = believed()
        self.row = np.zeros((1, CONFIG.flat_space.shape[0]), np.float32)

    def sees(self, ranges: np.ndarray, motion: tuple[float, float, float] = (0, 0, 0)) -> list:
        """The cells (row, column) that show obstacles after a motion and a reading."""
        self.state.motions[0], self.state.ranges[0] = motion, ranges
        self.builder.observe(np.zeros(1, np.int64), self.state, self.row)
        patch = CONFIG.decode(MAP_PATCH, self.row[0]).channels["obstacles"][0]
        assert set(np.unique(patch)) <= {-1.0, 1.0}
        return np.argwhere(patch > 0).tolist()


def door(ahead: float, half: float = 0.45) -> np.ndarray:
    """Ranges to a door straight ahead, that far from the robot and twice `half` wide (m)."""
    eye_x, eye_y = LASER.mount[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (ahead - eye_x) / np.cos(BEARINGS)
        across = eye_y + ranges * np.sin(BEARINGS)
    return np.where((ranges > 0) & (np.abs(across) <= half), ranges, np.inf)


NOTHING = np.full(LASER.beams, np.inf)
HALF_TURN = (0.0, 0.0, math.pi)
AHEAD = [[3, 7], [3, 8]]
BEHIND = [[12, 7], [12, 8]]


def test_a_shut_door_is_remembered_when_the_robot_turns_away_until_a_beam_passes_it(
    two_rooms: World,
) -> None:
    robot = Robot(two_rooms)
    assert robot.sees(NOTHING) == []
    # 2.2 m ahead, 0.9 m wide: in cells of 0.5 m the fifth row from the middle, on both sides of it.
    assert robot.sees(door(2.2), (0.2, 0, 0)) == AHEAD
    assert robot.sees(NOTHING, HALF_TURN) == BEHIND
    assert robot.sees(NOTHING, (1.0, 0.0, 0.0)) == [[14, 7], [14, 8]]
    assert robot.sees(NOTHING, (-1.0, 0.0, 0.0)) == BEHIND
    # Where a single beam gets no echo, the door is still there; where none does, it is open.
    lacking = door(2.2)
    lacking[LASER.beams // 2] = np.inf
    assert robot.sees(lacking, HALF_TURN) == AHEAD
    assert robot.sees(NOTHING, (0.0, 0.0, 0.2)) == []


def test_a_surface_is_forgotten_after_some_metres(two_rooms: World) -> None:
    robot = Robot(two_rooms)
    robot.sees(door(1.7))
    robot.sees(NOTHING, HALF_TURN)
    for k in range(12):  # To and fro: what counts is the way, not the distance from the door.
        assert robot.sees(NOTHING, (0.25 if k % 2 else -0.25, 0.0, 0.0))
    assert robot.sees(NOTHING, (0.25, 0.0, 0.0)) == []


def test_a_new_episode_begins_without_obstacles(two_rooms: World) -> None:
    robot = Robot(two_rooms)
    assert robot.sees(door(2.2)) == AHEAD
    robot.builder.begin(0, two_rooms)
    assert robot.sees(NOTHING) == []


class Remembered:
    """The same memory, the slow and obvious way: points by cell."""

    def __init__(self) -> None:
        self.pose, self.travelled, self.moved = np.zeros(3), 0.0, [math.inf, math.inf]
        self.points: dict[tuple[int, int], tuple[float, float, float]] = {}

    def add(self, motion: np.ndarray, ranges: np.ndarray) -> None:
        patch = CONFIG.map_patch
        self.pose = compose(self.pose, motion)
        self.travelled += math.hypot(*motion[:2])
        self.moved = [self.moved[0] + math.hypot(*motion[:2]), self.moved[1] + abs(motion[2])]
        if max(self.moved) < 0.1:
            return
        self.moved = [0.0, 0.0]
        eye = compose(self.pose, np.array((*LASER.mount[:2], 0.0)))
        for cell, (x, y, seen) in list(self.points.items()):
            ahead, left = transform_points(inverse(eye), np.array((x, y)))
            part = int((pseudo_angle(ahead, left) + 2) / 4 * len(SENSOR.beams))
            beam, away = SENSOR.beams[part], math.hypot(ahead, left)
            beside = ranges[max(0, beam - 1) : beam + 2]
            in_view = beam >= 0 and away < patch.obstacle_range
            passed = in_view and (beside > away + 0.2).all()
            if passed or seen < self.travelled - patch.obstacle_memory:
                del self.points[cell]
        for bearing, length in zip(BEARINGS, ranges, strict=True):
            if length < patch.obstacle_range:
                end = length * np.array((math.cos(bearing), math.sin(bearing)))
                x, y = transform_points(eye, end)
                cell = math.floor(x / CELL), math.floor(y / CELL)
                self.points[cell] = x, y, self.travelled


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_it_is_what_a_list_of_points_would_be(two_rooms: World, seed: int) -> None:
    rng, robot, slow = np.random.default_rng(seed), Robot(two_rooms), Remembered()
    for _ in range(25):
        motion = np.array((rng.uniform(-0.2, 0.3), 0.0, rng.uniform(-0.6, 0.6)))
        # Surfaces of several beams, since a few are seen beside each other.
        ranges = np.repeat(rng.uniform(0.3, 6.0, -(-LASER.beams // 7)), 7)[: LASER.beams]
        robot.sees(ranges, tuple(motion))
        slow.add(motion, ranges)
        memory = robot.builder._obstacles
        found = memory.points[0, : memory.counts[0]]
        wanted = np.reshape(list(slow.points.values()), (-1, 3))
        found, wanted = (each[np.lexsort(each[:, :2].T)] for each in (found, wanted))
        np.testing.assert_allclose(found, wanted, atol=1e-9)
        assert (found[:, SEEN] >= memory.travelled[0] - memory.length).all()


def test_when_there_is_no_room_the_point_seen_longest_ago_goes(two_rooms: World) -> None:
    robot = Robot(two_rooms)
    memory = robot.builder._obstacles
    robot.builder._obstacles = memory._replace(points=np.zeros((1, 40, 3)))
    robot.sees(np.full(LASER.beams, 3.0))
    robot.sees(np.minimum(door(1.0), 3.0), (0.2, 0.0, 0.0))
    memory = robot.builder._obstacles
    points = memory.points[0, : memory.counts[0]]
    assert len(points) == 40
    assert (points[:, SEEN] == 0.2).all()
    assert np.count_nonzero(memory.slots) == 40


@pytest.mark.parametrize("name", ["obstacle_memory", "obstacle_range"])
@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, 51.0, "far"])
def test_impossible_lengths_are_refused(name: str, wrong: object) -> None:
    with pytest.raises(InputError, match=rf"MapPatchConfig.{name}: expected a length above 0"):
        MapPatchConfig(**{name: wrong})
