"""The log of commands, against a list of lists; and what is replayed from it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_env.sim import PIONEER_3DX
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.command_log import CommandLog
from albot_env.sim.sensors import Sensors
from albot_maps import load_world

ROBOTS = 3
CROWDED = "random:apartment:3?people=2&boxes=5&doors=2&rooms=4"


@given(
    acts=st.lists(
        st.one_of(
            st.integers(1, 20),
            st.tuples(st.integers(0, ROBOTS - 1), st.integers(0, 3)),
        ),
        max_size=12,
    )
)
def test_it_keeps_what_a_list_for_each_robot_keeps(acts: list[int | tuple[int, int]]) -> None:
    log = CommandLog(ROBOTS, block=4)
    kept: list[list[list[float]]] = [[] for _ in range(ROBOTS)]
    number = 0.0
    for act in acts:
        if isinstance(act, tuple):
            row, before = act
            kept[row] = [[-number, float(k)] for k in range(before)]
            log.restart(row, np.array(kept[row]).reshape(-1, 2))
            continue
        for _ in range(act):
            number += 1
            targets = np.array([[number, float(row)] for row in range(ROBOTS)])
            log.append(targets)
            for row, target in enumerate(targets.tolist()):
                kept[row].append(target)
    for row in range(ROBOTS):
        assert log.of(row).tolist() == kept[row]
    for _ in range(4):
        log.append(np.zeros((ROBOTS, 2)))
    held = sum(len(block) for block in log._blocks)
    assert held <= max(map(len, kept)) + 3 * 4


def _simulator(robots: int) -> BatchSimulator:
    return BatchSimulator(robots, robot=PIONEER_3DX, sensors=Sensors(), control_steps=2)


def _drive(simulator: BatchSimulator, targets: np.ndarray) -> None:
    simulator.clear_contacts()
    simulator.drive(np.tile(targets, (len(simulator.poses), 1)), 2)
    simulator.locate()
    simulator.sense()


@pytest.mark.parametrize("spec", ["square-loop", CROWDED])
def test_a_state_goes_on_in_any_simulator(spec: str) -> None:
    """In itself, in a new one, and in a batch whose robots are under way in the same world."""
    world, rng = load_world(spec), np.random.default_rng(4)
    one, fresh, batch = _simulator(1), _simulator(1), _simulator(20)
    for simulator in (one, batch):
        for row in range(len(simulator.poses)):
            simulator.place(row, world, world.starts[0], 5 + row)
    targets = np.repeat(rng.uniform(-0.5, 1.2, (30, 2)), 10, axis=0)
    for target in targets[:150]:
        _drive(one, target)
        _drive(batch, target[::-1])
    state, bystander = one.state(0), batch.states[3].copy()
    fresh.set_state(0, world, state)
    batch.set_state(17, world, state)
    np.testing.assert_array_equal(batch.states[3], bystander)
    for target in targets[150:]:
        _drive(one, target)
        for simulator, row in ((fresh, 0), (batch, 17)):
            _drive(simulator, target)
            assert simulator.states[row].tobytes() == one.states[0].tobytes()
            assert simulator.ranges[row].tobytes() == one.ranges[0].tobytes()
            assert simulator.motions[row].tobytes() == one.motions[0].tobytes()
            assert simulator.obstacles(row).tobytes() == one.obstacles(0).tobytes()
    assert one.state(0).targets.shape == fresh.state(0).targets.shape == (300, 2)


def test_a_state_whose_motion_is_another_here_is_refused() -> None:
    """As one from a machine with another libm would be."""
    world, simulator = load_world("square-loop"), _simulator(1)
    simulator.place(0, world, world.starts[0], 5)
    for _ in range(5):
        _drive(simulator, np.array((0.5, 0.4)))
    state = simulator.state(0)
    state.robot["states"][0] = np.nextafter(state.robot["states"][0], 9.0)
    with pytest.raises(InputError, match="state: expected one from such a processor"):
        simulator.set_state(0, world, state)
