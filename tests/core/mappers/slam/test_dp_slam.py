"""DP-SLAM as a whole: against a slow one that copies maps, in a known room, and its limits."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.slam.ancestral_paths import AncestralPaths
from albot_core.mappers.slam.dp_slam import DpSlam, resample
from albot_core.mappers.slam.dp_slam_config import DpSlamConfig, MotionModel
from albot_core.mappers.slam.opacity import SLIVER, used_beams
from albot_core.mappers.slam.tiles import NONE
from albot_core.maps.layers import OccupancyGridLayer, ParticlesLayer, TrajectoryLayer
from albot_core.sensing.reading import LaserGeometry, Reading
from tests.core.mappers.slam.rooms import LASER, ROOM, reading_from
from tests.core.mappers.slam.test_opacity import walked_likelihood

CONFIG = DpSlamConfig(
    particles=4, samples=3, cell=0.1, reach=4.0, beams=20, motion=MotionModel(least_turn=0.03)
)


def drive(count: int, laser: LaserGeometry = LASER) -> list[Reading]:
    """A robot that goes round in the room, with an odometer that turns too far."""
    pose, readings = np.array((-2.0, -1.0, 0.3)), []
    for k in range(count):
        step = np.array((0.2, 0.0, 0.15 if k else 0.0))
        measured = step + np.array((0.0, 0.0, 0.02))
        readings.append(reading_from(pose, measured if k else np.zeros(3), ROOM, laser))
        pose = compose(pose, step)
    return readings


Squares = dict[tuple[int, int], tuple[float, float]]


class CopyingSlam(DpSlam):
    """The same filter as one would write it first: each particle has a map of its own."""

    def reset(self, rng):
        super().reset(rng)
        self.copies: list[Squares] = [{}]

    def _weigh(self, samples, origins, beams):
        logs = []
        for sample, origin in zip(samples, origins, strict=True):
            total = 0.0
            for length, direction, stopped in zip(
                beams.lengths, beams.directions, beams.stopped, strict=True
            ):
                heading = sample[2] + math.atan2(direction[1], direction[0])
                likelihood = walked_likelihood(
                    self.copies[origin],
                    (*compose(sample, np.array((*beams.eye, 0.0)))[:2], heading),
                    (0.0, min(length + self._model.beyond, self._model.reach)),
                    length,
                    stopped=bool(stopped),
                    model=self._model,
                )
                total += math.log(max(likelihood, self._model.floor))
            logs.append(total)
        self.logs = np.array(logs)
        return super()._weigh(samples, origins, beams)

    def _enter(self, parents, beams):
        super()._enter(parents, beams)
        self.copies = [dict(self.copies[parent]) for parent in parents]
        for copy, pose in zip(self.copies, self._poses, strict=True):
            enter_slowly(copy, pose, beams, self.config)


def enter_slowly(copy: Squares, pose: np.ndarray, beams, config: DpSlamConfig) -> None:
    """Enter a scan into a particle's own map, by cutting each beam where it crosses the grid."""
    x, y, _ = compose(pose, np.array((*beams.eye, 0.0)))
    seen: Squares = {}
    for length, direction, stopped in zip(
        beams.lengths, beams.directions, beams.stopped, strict=True
    ):
        heading = pose[2] + math.atan2(direction[1], direction[0])
        ux, uy = math.cos(heading), math.sin(heading)
        cuts = [0.0, float(length)]
        for start, unit in ((x, ux), (y, uy)):
            low, high = sorted((start, start + length * unit))
            lines = range(math.ceil(low / config.cell), math.floor(high / config.cell) + 1)
            cuts += [(line * config.cell - start) / unit for line in lines if unit]
        ordered = sorted(cut for cut in cuts if 0 <= cut <= length)
        for one, other in pairwise(ordered):
            is_hit = bool(other == length and stopped)
            if other - one <= SLIVER and not is_hit:
                continue
            middle = 0.5 * (one + other)
            key = (
                math.floor((x + middle * ux) / config.cell),
                math.floor((y + middle * uy) / config.cell),
            )
            hits, distance = seen.get(key, (0.0, 0.0))
            seen[key] = hits + is_hit, distance + max(other - one, SLIVER)
    for key, (hits, distance) in seen.items():
        before = copy.get(key, (0.0, config.prior_squares * config.cell))
        copy[key] = before[0] + hits, before[1] + distance


def known_by(mapper: DpSlam, particle: int) -> Squares:
    beams, corner = mapper._map.known_by(int(mapper._nodes[particle]))
    known = np.argwhere(beams[:, :, 1] > 0)
    return {(c + corner[1], r + corner[0]): tuple(beams[r, c]) for r, c in known.tolist()}


def test_it_does_what_a_filter_with_a_map_for_each_particle_does():
    slow = CopyingSlam(replace(CONFIG, cull=1e6))
    for reading in drive(6):
        slow.update(reading)
        for particle, copy in enumerate(slow.copies):
            known = known_by(slow, particle)
            assert known.keys() == copy.keys()
            for key, beams in copy.items():
                assert known[key] == pytest.approx(beams, rel=1e-4)
    assert len(slow.copies) > 1


def test_the_weights_are_those_of_the_slow_walk():
    slow, weights = CopyingSlam(replace(CONFIG, cull=1e6)), []
    weigh = slow._weigh

    def weigh_and_keep(samples, origins, beams):
        found = weigh(samples, origins, beams)
        expected = np.exp(slow.logs - slow.logs.max())
        weights.append((found, expected / expected.sum()))
        return found

    slow._weigh = weigh_and_keep
    for reading in drive(4):
        slow.update(reading)
    assert len(weights) == 3
    for found, expected in weights:
        np.testing.assert_allclose(found, expected, rtol=1e-3)
        assert found.max() > 1.5 * found.min()


def test_a_sample_that_is_given_up_had_no_chance():
    many = replace(CONFIG, particles=20, samples=10, beams=180, motion=MotionModel(least_turn=0.3))
    kept, culled = DpSlam(replace(many, cull=1e6)), DpSlam(many)
    for reading in drive(6):
        for mapper in (kept, culled):
            mapper.update(reading)
    beams = used_beams(drive(7)[6].laser, many.beams, many.reach)
    samples, origins = kept._move_particles(np.array((0.2, 0.0, 0.15)))
    all_weights = kept._weigh(samples, origins, beams)
    culled.restore(kept.state())
    some_weights = culled._weigh(samples, origins, beams)
    assert (some_weights == 0).sum() > 20
    assert all_weights[some_weights == 0].sum() < 0.05


@pytest.fixture(scope="module")
def led() -> DpSlam:
    mapper = make_mapper("dp-slam", config={"particles": 30}, rng=np.random.default_rng(1))
    for reading in drive(25):
        mapper.update(reading)
    return mapper


def test_it_corrects_an_odometer_that_turns_too_far(led):
    mapper, truth, odometry = led, np.zeros(3), np.zeros(3)
    for k, reading in enumerate(drive(25)):
        if k:
            truth = compose(truth, np.array((0.2, 0.0, 0.15 if k > 1 else 0.0)))
            odometry = compose(odometry, reading.motion)
    off = relative(truth, mapper.estimate.pose)
    assert abs(relative(truth, odometry)[2]) > 0.4
    assert np.hypot(*off[:2]) < 0.1
    assert abs(off[2]) < 0.05
    # The corrected poses end where it believes to be, and lie along the way.
    corrected = mapper.corrected_poses()
    np.testing.assert_allclose(corrected[-1], mapper.estimate.pose, atol=1e-12)
    assert corrected.shape == (25, 3)
    steps = np.hypot(*np.diff(corrected[:, :2], axis=0).T)
    assert np.median(abs(steps - 0.2)) < 0.05


def test_the_walls_are_where_they_are(led):
    mapper = led
    layer = mapper.snapshot().layer(OccupancyGridLayer)
    # From the first pose's frame to that of the room.
    points = layer.centres(0.5) @ [[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]
    x, y = (points + np.array((-2.0, -1.0))).T
    off = np.min([abs(x + 4), abs(x - 5), abs(y + 3), abs(y - 4), abs(x - 1)], axis=0)
    assert np.quantile(off, 0.9) < 0.1
    assert len(off) > 300
    particles = mapper.snapshot().layer(ParticlesLayer)
    assert particles.weights.sum() == pytest.approx(1)
    assert len(particles.poses) <= mapper.config.particles
    assert mapper.snapshot().layer(TrajectoryLayer).poses.shape == (25, 3)


def test_scans_are_used_once_the_robot_has_moved():
    mapper = make_mapper("dp-slam")
    first, second, third = drive(3)
    assert mapper.update(first)
    assert not mapper.update(replace(second, motion=np.array((0.02, 0, 0))))
    assert not mapper.update(replace(second, motion=np.array((0.02, 0, 0))))
    assert mapper.estimate.updates == 1
    np.testing.assert_allclose(mapper.estimate.pose, (0.04, 0, 0))
    assert mapper.update(replace(third, motion=np.array((0.02, 0, 0))))
    assert mapper.corrected_poses().shape == (4, 3)
    np.testing.assert_allclose(mapper.corrected_poses()[1:3, 0], (0.02, 0.04))


def test_ground_beyond_all_buildings_is_refused_and_nothing_changes():
    mapper = make_mapper("dp-slam", config={"particles": 5})
    readings = drive(4)
    for reading in readings[:3]:
        mapper.update(reading)
    before = mapper.state()
    for far in (1e4, 1e300):
        wild = replace(readings[3], motion=np.array((far, 0.0, 0.0)))
        with pytest.raises(InputError, match=r"occupancy grid: expected ground that fits"):
            mapper.update(wild)
    for key, array in mapper.state().items():
        np.testing.assert_array_equal(array, before[key], err_msg=key)
    assert mapper.memory["bytes"] < 50e6
    mapper.update(readings[3])


def test_paths_of_the_dead_are_dropped():
    rng, paths = np.random.default_rng(4), AncestralPaths()
    copies = [[]]
    for update in range(600):
        parents = np.sort(rng.integers(len(copies), size=20)) if update else np.zeros(20, int)
        poses = rng.normal(size=(20, 3))
        paths.add_poses(poses, parents)
        copies = [[*copies[p], pose] for p, pose in zip(parents.tolist(), poses, strict=True)]
    for particle, copy in enumerate(copies):
        np.testing.assert_array_equal(paths.poses_of(particle), copy)
    # Of 12,000 poses most were of particles that have died out.
    assert len(paths.state()["path.poses"]) < 1000


def test_resampling_draws_by_weight_and_keeps_so_many_kinds():
    rng = np.random.default_rng(2)
    weights = np.array((0.5, 0.0, 0.3, 0.2))
    draws, sums = np.zeros(4, np.int64), np.empty(4)
    resample(weights, rng.random(20_000), 4, sums, draws)
    np.testing.assert_allclose(draws / 20_000, weights, atol=0.02)
    draws[:] = 0
    resample(weights, np.array((0.9, 0.1, 0.99, 0.0, 0.5)), 2, sums, draws)
    # The first two are the fourth and the first sample; the others are drawn among them.
    assert draws.tolist() == [3, 0, 0, 2]
    assert draws.sum() == 5


def test_motions_are_as_spread_as_the_model_says():
    model = MotionModel()
    mapper = make_mapper("dp-slam", config={"particles": 100, "samples": 100})
    mapper._paths.readings = 1
    moved = np.array((0.9, 0.1, 0.4))
    samples, origins = mapper._move_particles(moved)
    assert len(samples) == 10_000
    assert not origins.any()
    np.testing.assert_allclose(samples.mean(axis=0), moved, atol=0.01)
    middle = samples[:, 2] / 2
    along = np.cos(middle) * samples[:, 0] + np.sin(middle) * samples[:, 1]
    across = np.cos(middle) * samples[:, 1] - np.sin(middle) * samples[:, 0]
    found = np.array((along.std(), across.std(), samples[:, 2].std()))
    distance = math.hypot(0.9, 0.1)
    expected = (
        0.156 * distance + 1.9924 / 35 * 0.4,
        0.063 * distance + 2.2992 / 35 * 0.4,
        max(0.028 * distance + 0.1405 * 0.4, model.least_turn),
    )
    np.testing.assert_allclose(found, expected, rtol=0.05)
    np.testing.assert_allclose(model.deviations(0.0, 0.0), (0.8 / 35, 0.8 / 35, model.least_turn))


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("best", lambda a: a + 99, "best: expected whole numbers from 0 to less than"),
        ("particles.draws", lambda a: a * 0, "particles.draws"),
        ("particles.poses", lambda a: a * np.nan, "finite"),
        ("particles.nodes", lambda a: a * 0, "each once"),
        ("path.before", lambda a: np.arange(len(a)), "path.before"),
        ("path.last", lambda a: a + 10**6, "path.last"),
        ("path.updates", lambda a: a + 1, "every path"),
        ("path.reading_updates", lambda a: a + 10, "path.reading_updates"),
        ("path.reading_motions", lambda a: a[:-1], "shape"),
    ],
)
def test_damaged_arrays_are_refused(name, damage, message):
    mapper = DpSlam(CONFIG)
    for reading in drive(6):
        mapper.update(reading)
    assert len(mapper._nodes) > 1
    state = mapper.state()
    state[name] = np.asarray(damage(state[name]))
    with pytest.raises(InputError, match=message):
        DpSlam(CONFIG).restore(state)
    assert NONE == -1


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"particles": 1}, "particles"),
        ({"cell": 0.0}, "cell"),
        ({"reach": 1e9}, "reach"),
        ({"floor": 1.0}, "floor"),
        ({"step": -1.0}, "step"),
    ],
)
def test_a_config_of_no_filter_is_refused(wrong, named):
    with pytest.raises(InputError, match=rf"DpSlamConfig\..*{named}"):
        DpSlamConfig(**wrong)
    with pytest.raises(InputError, match=r"MotionModel\.least"):
        MotionModel(least=-1.0)
