"""Experiences, transitions and ways over them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from albot_core.mappers.ratslam.config import (
    CorrectionConfig,
    ExperienceConfig,
    PoseCellConfig,
)
from albot_core.mappers.ratslam.experiences import FASTEST, ExperienceMap
from albot_core.mappers.ratslam.pose_cells import Packet

CELLS = PoseCellConfig(columns=64, rows=64)


def new_map(**config) -> ExperienceMap:
    return ExperienceMap(ExperienceConfig(**config), CELLS, CorrectionConfig())


def energy(cell, packet, config: ExperienceConfig) -> float:
    """Eq. (2) to (9) for an experience of the view that is seen."""
    size = np.array((CELLS.columns, CELLS.rows, CELLS.headings))
    apart = np.abs(np.array(cell) - packet[:3])
    apart = np.minimum(apart, size - apart)
    r = np.hypot(*apart[:2]) * CELLS.cell
    turn = apart[2] * CELLS.cell_turn
    near, aligned = max(0.0, 1 - r / config.radius), max(0.0, 1 - turn / config.turn)
    both = near > 0 and aligned > 0
    return near + aligned if both or config.position_or_heading else 0.0


@pytest.mark.parametrize("either", [False, True])
def test_the_experience_with_the_most_energy_is_active(either):
    rng = np.random.default_rng(0)
    config = ExperienceConfig(position_or_heading=either)
    world = new_map(position_or_heading=either)
    places = rng.uniform(0, (64, 64, 36), (200, 3))
    views = rng.integers(0, 3, 200)
    for k, place in enumerate(places):
        world.add((0.0, 0.0, 0.0), Packet(*place, 1.0), int(views[k]), 0.0, k)
    answers = set()
    for _ in range(300):
        packet = Packet(*rng.uniform(0, (64, 64, 36)), 1.0)
        view = int(rng.integers(-1, 4))
        energies = [
            energy(place, packet, config) if views[k] == view else 0.0
            for k, place in enumerate(places)
        ]
        expected = int(np.argmax(energies)) if max(energies) > 0 else -1
        assert world.active(view, packet) == expected
        answers.add(expected >= 0)
    assert answers == {True, False}


def chain(count: int) -> ExperienceMap:
    """Experiences a metre apart, in a row."""
    world = new_map()
    for k in range(count):
        world.add((float(k), 0.0, 0.0), Packet(k % 64, 0.0, 0.0, 1.0), k, 0.0, k)
        if k:
            assert world.connect(k - 1, k, (1.0, 0.0, 0.0), 2.0, 0.0, 0.0, 10)
    return world


def test_a_transition_driven_again_is_the_mean_and_the_quickest():
    world = chain(3)
    assert not world.connect(0, 1, (1.2, 0.2, 2 * np.pi), 1.0, 0.0, 0.0, 10)
    np.testing.assert_allclose(world.links.rows("motion")[0], (1.1, 0.1, 0.0), atol=1e-12)
    assert world.links.rows("time")[0] == 1.0
    assert world.links.count == 2
    assert world.connect(1, 0, (-1.0, 0.0, 0.0), 2.0, 0.0, 0.0, 10)


def test_the_quickest_ways_are_dijkstras():
    rng = np.random.default_rng(3)
    world = chain(40)
    for _ in range(120):
        i, j = rng.choice(40, 2, replace=False).tolist()
        world.connect(
            i, j, (float(rng.normal()), 0.0, 0.0), float(rng.uniform(0.5, 30)), 0.0, 0.0, 10
        )
    links = world.links
    times = np.full((40, 40), np.inf)
    for k in range(links.count):
        i, j, time = links["source"][k], links["target"][k], links["time"][k]
        times[i, j] = times[j, i] = min(times[i, j], time)
    graph = csr_matrix(np.where(np.isinf(times), 0, times))
    for goal in (0, 7, 39):
        expected = dijkstra(graph, indices=goal)
        found, lengths, onward = world.ways_to(goal)
        np.testing.assert_allclose(found, expected)
        assert np.isfinite(lengths).all()
        assert onward[goal] == -1
        here, steps = 20, 0
        while here != goal:
            assert found[onward[here]] < found[here]
            here, steps = int(onward[here]), steps + 1
        assert steps < 40
    np.testing.assert_allclose(world.experiences.rows("time"), dijkstra(graph, indices=0))


def two_routes() -> ExperienceMap:
    """A short route over experience 1, of 2 m in 20 s, and a long one over 2, of 8 m in 8 s."""
    world = new_map()
    for k, pose in enumerate(((0, 0, 0), (1, 0, 0), (1, 3, 0), (2, 0, 0))):
        world.add(pose, Packet(*pose, 1.0), k, 0.0, k)
    for source, target, length, time in ((0, 1, 1.0, 10.0), (1, 3, 1.0, 10.0)):
        world.connect(source, target, (length, 0.0, 0.0), time, 0.0, 0.0, 10)
    for source, target, length, time in ((0, 2, 4.0, 4.0), (2, 3, 4.0, 4.0)):
        world.connect(source, target, (length, 0.0, 0.0), time, 0.0, 0.0, 10)
    return world


def test_a_goal_is_reached_by_the_quicker_route_not_by_the_shorter_one():
    """Section 7: the durations of the transitions give the quickest route."""
    world = two_routes()
    times, lengths, onward = world.ways_to(3)
    assert (times[0], lengths[0], onward[0], onward[2]) == (8.0, 8.0, 2, 3)
    times, _, onward = world.ways_to(0)  # And back.
    assert (times[3], onward[3], onward[2]) == (8.0, 2, 0)
    assert world.experiences.rows("onward").tolist() == [-1, 0, 0, 2]  # The ways home, too.


def test_a_route_that_was_driven_quickly_once_is_the_quicker_one_from_then_on():
    world = two_routes()
    for source, target in ((1, 0), (3, 1)):  # Driven back without a stop; links lead both ways.
        world.connect(source, target, (-1.0, 0.0, 0.0), 2.0, 0.0, 0.0, 10)
    times, lengths, onward = world.ways_to(3)
    assert (times[0], lengths[0], onward[0]) == (4.0, 2.0, 1)
    assert world.experiences.rows("time").tolist() == [0.0, 2.0, 4.0, 4.0]


def test_stamps_that_stand_still_are_no_way_in_no_time():
    world = new_map()
    world.add((0.0, 0.0, 0.0), Packet(0, 0, 0, 1), 0, 0.0, 0)
    world.add((5.0, 0.0, 0.0), Packet(9, 0, 0, 1), 1, 0.0, 1)
    world.connect(0, 1, (5.0, 0.0, 0.0), -3.0, 0.0, 0.0, 1)
    assert world.links.rows("time")[0] == 5.0 / FASTEST


def test_two_experiences_at_one_place_are_both_kept():
    world = chain(3)
    world.add((2.0, 0.0, 0.0), Packet(2, 0, 0, 1), 9, 0.0, 3)
    assert world.connect(2, 3, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 1)
    for _ in range(50):
        world.correct()
    assert np.isfinite(world.poses).all()
    np.testing.assert_allclose(world.poses[3], world.poses[2])


def test_a_measurement_weighs_less_the_more_its_poses_rest_on_scenes():
    """The variance of the odometer, 1/4 of a scene's, over the whole variance is the weight."""
    config = CorrectionConfig(recognised=0.25)
    world = ExperienceMap(ExperienceConfig(), PoseCellConfig(), config)
    for k in range(2):
        world.add((float(k), 0.0, 0.0), Packet(0.0, 0.0, 0.0, 1.0), k, 0.0, k)
    links = world.links
    world.connect(0, 1, (1.0, 0.0, 0.0), 1.0, 0.0, 0.75, 1)
    assert links["weight"][0] == links["stiffness"][0] == pytest.approx(0.25)
    world.connect(0, 1, (2.0, 0.0, 0.0), 1.0, 0.0, 1.75, 1)  # 0.25 / (0.25 + 1.75) = 1/8.
    assert links["weight"][0] == pytest.approx(0.375)
    assert links["motion"][0, 0] == pytest.approx(1.0 + (1 / 8) / 0.375)
    for _ in range(9):
        world.connect(0, 1, (1.0, 0.0, 0.0), 1.0, 0.0, 0.75, 6)
    assert links["stiffness"][0] == 1.0  # Weights add up, but no link is more than stiff.


def test_a_bias_of_the_odometer_makes_scenes_weigh_more():
    world = ExperienceMap(ExperienceConfig(), PoseCellConfig(), CorrectionConfig())
    weights = []
    for k, bias in enumerate((0.0, 0.05, 0.2)):
        for side in range(2):
            world.add((0.0, 0.0, 0.0), Packet(0.0, 0.0, 0.0, 1.0), 2 * k + side, 0.0, k)
        world.connect(2 * k, 2 * k + 1, (1.0, 0.0, 0.0), 2.0, bias, 1.0, 1)
        weights.append(world.links["weight"][k])
    assert weights[0] == pytest.approx(0.1 / 1.1)
    assert weights[0] < weights[1] < weights[2] < 1.0
