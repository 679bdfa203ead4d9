"""The sonars' geometry: closed forms, a dense fan of exact rays, and what must not matter."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.sensing.reading import SonarGeometry
from albot_env.sim import PIONEER_3DX, Sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.sensing import SONAR_COUNTER
from albot_env.sim.sonar import SONARS, SonarConfig
from albot_env.sim.sonar_echoes import make_sonar_buffers
from albot_env.sim.sonar_kernels import measure_echoes
from albot_maps import load_world

CONE = math.pi / 6
NOTHING = np.empty((0, 4))


def one_sonar(**options: float) -> SonarConfig:
    """A single sonar at the robot's middle that points ahead."""
    geometry = SonarGeometry(bearings=(0.0,), places=((0.0, 0.0),), min_range=0.0)
    return SonarConfig(geometry=geometry, **options)


def heard(
    config: SonarConfig,
    walls: np.ndarray,
    pose: tuple[float, float, float] | np.ndarray = (0.0, 0.0, 0.0),
    obstacles: np.ndarray = NOTHING,
    key: int = 1,
    place: int = 0,
) -> np.ndarray:
    echoes = np.empty(len(config.geometry.bearings))
    everything = np.arange(len(walls), dtype=np.int32)
    where = np.array(pose, np.float64)
    cones, key = make_sonar_buffers(len(walls) + len(obstacles), len(echoes)), np.uint64(key)
    measure_echoes(
        walls,
        everything,
        obstacles,
        transform_of(where),
        config.constants,
        key,
        place,
        cones,
        echoes,
    )
    return echoes


def wall(distance: float, turn: float = 0.0, half: float = 3.0) -> np.ndarray:
    """A wall whose perpendicular from the origin has this length and bearing."""
    foot = distance * np.array((math.cos(turn), math.sin(turn)))
    along = half * np.array((-math.sin(turn), math.cos(turn)))
    return np.array([[*(foot - along), *(foot + along)]])


@pytest.mark.parametrize("bearing", np.linspace(-math.pi, math.pi, 13))
def test_a_sonar_hears_the_same_wherever_on_the_robot_it_points(bearing: float) -> None:
    """Also where its cone reaches behind the robot: among short walls, and in every direction."""
    rng = np.random.default_rng(3)
    middles, halves = rng.uniform(-4, 4, (60, 2)), rng.uniform(-0.4, 0.4, (60, 2))
    walls = np.hstack((middles - halves, middles + halves))
    mounted = SonarGeometry(bearings=(float(bearing),), places=((0.1, -0.2),), min_range=0.0)
    for heading in np.arange(0.0, 6.0, 0.25).tolist():
        x, y = 0.1 * math.cos(heading) + 0.2 * math.sin(heading), 0.1 * math.sin(heading)
        there = x, y - 0.2 * math.cos(heading), heading + bearing
        turned = heard(SonarConfig(geometry=mounted), walls, (0.0, 0.0, heading))
        np.testing.assert_allclose(turned, heard(one_sonar(), walls, there), rtol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.2, -0.26])
def test_a_wall_is_as_far_as_its_perpendicular(turn: float) -> None:
    assert heard(one_sonar(), wall(1.5, turn))[0] == pytest.approx(1.5, abs=1e-12)


@pytest.mark.parametrize("turn", [0.5, -0.9, 1.3])
def test_a_wall_aslant_is_as_far_as_the_cone_s_edge(turn: float) -> None:
    expected = 0.5 / math.cos(abs(turn) - CONE / 2)
    assert heard(one_sonar(), wall(0.5, turn))[0] == pytest.approx(expected)


def test_a_wall_beyond_the_specular_limit_is_lost() -> None:
    limit = math.radians(20)
    just, beyond = CONE / 2 + limit - 1e-6, CONE / 2 + limit + 1e-6
    config = one_sonar(specular_limit=limit)
    assert heard(config, wall(1.0, just))[0] == pytest.approx(1 / math.cos(limit), rel=1e-5)
    assert np.isinf(heard(config, wall(1.0, beyond))[0])


def test_a_grazing_wall_hides_what_is_behind_it() -> None:
    config = one_sonar(specular_limit=math.radians(20))
    behind, before = wall(3.0), wall(0.6, 0.9, 5.0)
    assert heard(config, behind)[0] == pytest.approx(3.0)
    assert np.isinf(heard(config, np.vstack((behind, before)))[0])


def test_a_wall_half_hidden_is_heard_beside_what_hides_it() -> None:
    """The screen ends at bearing 0.1: the wall is heard past its end, aslant."""
    screen = np.array([[1.0, -2.0, 1.0, math.tan(0.1)]]) * 0.5
    config = one_sonar(specular_limit=0.2)
    both = np.vstack((wall(2.0), screen))
    assert heard(config, both)[0] == pytest.approx(0.5)
    lost = np.array([[0.3, -0.3, 0.8, 0.8 * math.tan(0.1)]])  # too aslant to be heard
    both = np.vstack((wall(2.0), lost))
    assert heard(config, both)[0] == pytest.approx(2.0 / math.cos(0.1))


def test_things_and_walls_are_heard_alike() -> None:
    assert heard(one_sonar(), wall(2.0), obstacles=wall(1.0))[0] == pytest.approx(1.0)
    assert heard(one_sonar(), NOTHING, obstacles=wall(1.0))[0] == pytest.approx(1.0)


def test_ranges_end_where_the_sonar_s_do() -> None:
    config = SonarConfig(geometry=SonarGeometry(bearings=(0.0,), places=((0.2, 0.0),)))
    assert heard(config, wall(0.25))[0] == 0.1
    assert heard(config, wall(4.199))[0] == pytest.approx(3.999)
    assert np.isinf(heard(config, wall(4.201))[0])
    assert np.isinf(heard(config, NOTHING)[0])


def test_the_pioneer_s_eight_sonars_stand_where_they_do() -> None:
    """In a corridor 2 m wide the outer ones hear the walls, 1 m less 13.6 cm away."""
    walls = np.vstack((wall(1.0, math.pi / 2, 20), wall(1.0, -math.pi / 2, 20)))
    echoes = heard(SONARS["ideal"], walls)
    assert echoes[[0, 7]] == pytest.approx(1 - 0.136)
    assert echoes[[1, 6]] == pytest.approx((1 - 0.119) / math.cos(math.radians(25)))
    assert np.array_equal(echoes, echoes[::-1])


LATTICE = st.integers(-16, 16).map(lambda k: k / 8)
SCENES = st.lists(st.tuples(LATTICE, LATTICE, LATTICE, LATTICE), min_size=4, max_size=14)
LIMITS = st.sampled_from([math.pi / 2, 0.6, 0.35, 0.1])


def cast(walls: np.ndarray, bearings: np.ndarray, limit: float) -> float:
    """The oracle: the nearest hit of rays from the origin, where it is not hit too aslant."""
    u = np.stack((np.cos(bearings), np.sin(bearings)), axis=1)[:, None]
    start, edge = walls[:, :2], walls[:, 2:] - walls[:, :2]
    across = u[..., 0] * edge[:, 1] - u[..., 1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0]) / across
        along = (start[:, 0] * u[..., 1] - start[:, 1] * u[..., 0]) / across
    reach[~((reach > 0) & (along >= 0) & (along <= 1))] = np.inf
    first = reach.argmin(axis=1)
    ranges = reach[np.arange(len(u)), first]
    cosine = np.abs(across[np.arange(len(u)), first]) / np.hypot(*edge[first].T)
    ranges[np.arccos(np.minimum(cosine, 1)) > limit] = np.inf
    return float(ranges.min())


def fan(walls: np.ndarray, limit: float) -> np.ndarray:
    """2000 bearings in the cone, and those beside which something may begin or end."""
    edge = walls[:, 2:] - walls[:, :2]
    feet = np.arctan2(edge[:, 1], edge[:, 0]) + math.pi / 2
    marks = [np.arctan2(walls[:, 1], walls[:, 0]), np.arctan2(walls[:, 3], walls[:, 2])]
    marks += [feet + k * math.pi + side * limit for k in (0, 1) for side in (-1, 0, 1)]
    for i, first in enumerate(walls):
        for j in range(i):
            matrix = np.stack((edge[i], -edge[j]), axis=1)
            if abs(np.linalg.det(matrix)) > 1e-9:
                share = np.linalg.solve(matrix, walls[j, :2] - first[:2])[0]
                x, y = first[:2] + share * edge[i]
                marks.append(np.array([math.atan2(y, x)]))
    special = np.concatenate([np.concatenate(marks) + step for step in (-3e-7, 3e-7)])
    special = (special + math.pi) % (2 * math.pi) - math.pi
    evenly = np.linspace(-CONE / 2, CONE / 2, 2000)
    return np.concatenate((evenly, special[np.abs(special) <= CONE / 2]))


# Shrinking a scene takes minutes; the scene itself says enough.
@settings(max_examples=150, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(SCENES, LIMITS, st.tuples(LATTICE, LATTICE, st.floats(-3, 3)))
def test_the_cone_hears_what_a_dense_fan_of_rays_meets(
    scene: list[tuple[float, float, float, float]], limit: float, pose: tuple[float, float, float]
) -> None:
    walls = np.array([w for w in scene if w[:2] != w[2:]]).reshape(-1, 4)
    # From beside the lattice: on a wall's own line the wall is not seen.
    x, y, heading = pose[0] + 0.0613, pose[1] + 0.0371, pose[2]
    found = heard(one_sonar(specular_limit=limit), walls, (x, y, heading))[0]
    cos, sin = math.cos(heading), math.sin(heading)
    local = (walls.reshape(-1, 2) - (x, y)) @ np.array(((cos, -sin), (sin, cos)))
    local = local.reshape(-1, 4)
    expected = cast(local, fan(local, limit), limit) if len(local) else np.inf
    assert min(found, 4.0) == pytest.approx(min(expected, 4.0), abs=1e-4)


@settings(max_examples=40, deadline=None)
@given(SCENES, st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3)))
def test_moving_the_world_and_the_robot_changes_no_echo(
    scene: list[tuple[float, float, float, float]], motion: tuple[float, float, float]
) -> None:
    walls = np.array([w for w in scene if w[:2] != w[2:]]).reshape(-1, 4)
    pose, moved = np.array((0.0613, 0.0371, 0.7)), np.array(motion)
    config = SonarConfig(specular_limit=1.5, range_noise=0.02, dropout=0.1, crosstalk=0.3)
    ends = np.hstack((walls.reshape(-1, 2), np.zeros((2 * len(walls), 1))))
    turned = compose(moved, ends)[:, :2].reshape(-1, 4)
    echoes = heard(config, walls, pose)
    again = heard(config, turned, compose(moved, pose))
    finite = np.isfinite(echoes) & np.isfinite(again)
    np.testing.assert_allclose(echoes[finite], again[finite], atol=1e-6)
    assert (np.minimum(echoes, again)[~finite] > 3.8).all()


def test_the_order_of_the_walls_does_not_matter_nor_those_too_far() -> None:
    rng = np.random.default_rng(4)
    walls = rng.uniform(-5, 5, (40, 4))
    for pose in rng.uniform(-4, 4, (60, 3)):
        echoes = heard(SONARS["pioneer"], walls, pose)
        assert np.array_equal(echoes, heard(SONARS["pioneer"], walls[::-1].copy(), pose))
        near = [k for k, wall in enumerate(walls) if distance(wall, pose[:2]) < 4.2]
        assert np.array_equal(echoes, heard(SONARS["pioneer"], walls[near], pose))


def distance(wall: np.ndarray, point: np.ndarray) -> float:
    return float(shapely.distance(shapely.LineString(wall.reshape(2, 2)), shapely.Point(point)))


def test_a_batch_hears_as_if_it_listened_to_every_wall() -> None:
    world = load_world("random:office:42?rooms=8")
    rng = np.random.default_rng(5)
    x_min, y_min, x_max, y_max = world.bounds
    batch = BatchSimulator(1, robot=PIONEER_3DX, sensors=Sensors(sonar=SONARS["pioneer"]))
    for _ in range(200):
        pose = rng.uniform((x_min, y_min, -3), (x_max, y_max, 3))
        batch.place(0, world, pose, 1)
        batch.locate()
        batch.sense()
        every = heard(SONARS["pioneer"], world.walls, pose, place=SONAR_COUNTER)
        np.testing.assert_allclose(batch.echoes[0], every, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [("specular_limit", 0.0), ("specular_limit", 2.0), ("crosstalk", 1.5), ("edge_reach", -1.0)],
)
def test_impossible_sonars_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"SonarConfig.{field}: expected"):
        SonarConfig(**{field: value})


def test_every_sonar_has_its_place() -> None:
    with pytest.raises(InputError, match=r"SonarGeometry.places: expected 2 finite pairs"):
        SonarGeometry(bearings=(0.0, 1.0), places=((0.0, 0.0),))
