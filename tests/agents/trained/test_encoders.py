"""Encoders in numpy against PyTorch's, and against what is known of convolutions and attention."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from hypothesis import given, settings
from hypothesis import strategies as st
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from scipy.sparse.csgraph import dijkstra
from stable_baselines3.common.policies import ActorCriticPolicy

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.registry import find_agent, make_agent
from albot_agents.scripted.patch_homing import grid_graph
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.card import write_card
from albot_agents.trained.encoders import PartEncoder, encode, path_costs
from albot_agents.trained.network import Network, NetworkConfig
from albot_agents.training.checkpoint import policy_weights
from albot_agents.training.encoders import (
    PartsExtractor,
    extractor_settings,
    set_planner_costs,
)
from albot_agents.training.plan import ALGORITHMS, ON_POLICY, PolicyPlan, TrainingPlan
from albot_agents.training.run import TrainingRun
from albot_core.errors import InputError
from albot_core.plain_data import deep_merge
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from tests.agents.training.tiny import TINY, begun, off_policy

PLACES, CONNECTIONS, COLUMNS = 5, 7, 9
PATCH = PartEncoder(part="map_patch", kind="convolution", begin=3, shape=(2, 9, 12), filters=(4, 3))
GRAPH = PartEncoder(
    part="place_graph", kind="attention", begin=3 + 216 + 2,
    shape=(PLACES + CONNECTIONS, COLUMNS), places=PLACES, units=6, heads=3,
)  # fmt: skip
LENGTH = GRAPH.begin + GRAPH.size + 1
PLANNER = PartEncoder(
    part="map_patch", kind="planner", begin=3, shape=(3, 8, 8), goal=2, radius=2
)  # fmt: skip
ENCODERS = {
    "cnn": (PATCH,), "attention": (GRAPH,), "multi_input": (PATCH, GRAPH), "planner": (PLANNER,),
}  # fmt: skip


def _rows(seed: int, count: int) -> np.ndarray:
    """Observations with graphs from empty to full, whose ends are rows of places."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-1, 1, (count, LENGTH)).astype(np.float32)
    taken = slice(GRAPH.begin, GRAPH.begin + GRAPH.size)
    graphs = rows[:, taken].reshape(count, -1, COLUMNS)
    graphs[:, :, 0] = np.where(rng.random(graphs.shape[:2]) < rng.random((count, 1)), 1, -1)
    graphs[0, :, 0] = -1
    ends = rng.integers(PLACES, size=(count, CONNECTIONS, 2))
    graphs[:, PLACES:, 1:3] = 2 * ends / (PLACES - 1) - 1
    rows[:, taken] = graphs.reshape(count, -1)
    return rows


def _originals(kind: str, lstm: bool) -> tuple[Any, Network]:
    """A policy with random weights, and the network made of it."""
    encoders = ENCODERS[kind]
    memory: dict[str, Any] = {"lstm_size": 5} if lstm else {}
    plan = TrainingPlan(
        algorithm="recurrent_ppo" if lstm else "ppo",
        policy=PolicyPlan(kind=kind, net_arch=(16,), **memory),
    )
    torch.manual_seed(3)
    make: Any = RecurrentActorCriticPolicy if lstm else ActorCriticPolicy
    policy = make(
        Box(-1, 1, (LENGTH,), np.float32),
        Box(-1, 1, (3,), np.float32),
        lambda _: 1e-3,
        net_arch=[16],
        **({"lstm_hidden_size": 5} if lstm else {}),
        **extractor_settings(encoders),
    )
    for parameter in policy.parameters():  # As large as training makes them, biases too.
        torch.nn.init.normal_(parameter, std=0.3)
    config = NetworkConfig(
        inputs=LENGTH, layers=(16,), activation="tanh", outputs=3, encoders=encoders,
        lstm_size=5 * lstm, lstm_layers=int(lstm),
    )  # fmt: skip
    state = {name: value.detach().numpy() for name, value in policy.state_dict().items()}
    weights = policy_weights(state, plan, encoders)
    assert {name: array.shape for name, array in weights.items()} == config.shapes
    return policy, Network(config, weights)


@pytest.mark.parametrize("lstm", [False, True])
@pytest.mark.parametrize("kind", ENCODERS)
def test_a_network_does_as_its_original(kind: str, lstm: bool) -> None:
    policy, network = _originals(kind, lstm)
    rows, state = _rows(1, 30), None
    for k, row in enumerate(rows):
        expected, state = policy.predict(row, state, np.array([k == 0]), deterministic=True)
        np.testing.assert_allclose(np.clip(network(row), -1, 1), expected, atol=1e-5)
    # What is encoded does count.
    changed = rows[5].copy()
    encoder = ENCODERS[kind][0]
    changed[encoder.begin + 1 : encoder.begin + encoder.size] *= -1
    network.reset()
    before = network(rows[5])
    network.reset()
    assert not np.allclose(network(changed), before, atol=1e-3)


def test_a_filter_sums_its_neighbourhood() -> None:
    """A filter of ones over a patch of ones: 9 inside, 6 at an edge, 4 in a corner."""
    encoder = PartEncoder(
        part="map_patch", kind="convolution", begin=0, shape=(1, 5, 5), filters=(1,)
    )
    weights = {
        "map_patch.filter0.weight": np.ones((1, 1, 3, 3), np.float32),
        "map_patch.filter0.bias": np.zeros(1, np.float32),
    }
    found = encode((encoder,), weights, np.ones(25, np.float32)).reshape(3, 3)
    np.testing.assert_array_equal(found, [[4, 6, 4], [6, 9, 6], [4, 6, 4]])


@given(st.integers(0, 2**32 - 1), st.permutations(range(CONNECTIONS)))
@settings(deadline=None, max_examples=30)
def test_the_order_of_connections_does_not_matter(seed: int, order: list[int]) -> None:
    weights = _graph_weights()
    row = _rows(seed, 2)[1]
    moved = row.copy()
    graph = moved[GRAPH.begin : GRAPH.begin + GRAPH.size].reshape(-1, COLUMNS)
    graph[PLACES:] = graph[PLACES:][order]
    np.testing.assert_allclose(
        encode((GRAPH,), weights, moved), encode((GRAPH,), weights, row), atol=1e-6
    )


@given(st.integers(0, 2**32 - 1), st.permutations(range(PLACES)))
@settings(deadline=None, max_examples=30)
def test_numbering_places_anew_does_not_matter(seed: int, order: list[int]) -> None:
    """Their rows move, and the ends of connections with them."""
    weights, row = _graph_weights(), _rows(seed, 2)[1]
    moved = row.copy()
    graph = moved[GRAPH.begin : GRAPH.begin + GRAPH.size].reshape(-1, COLUMNS)
    graph[order] = graph[:PLACES].copy()
    ends = np.rint((graph[PLACES:, 1:3] + 1) * (PLACES - 1) / 2).astype(int)
    graph[PLACES:, 1:3] = 2 * np.array(order)[ends] / (PLACES - 1) - 1
    np.testing.assert_allclose(
        encode((GRAPH,), weights, moved), encode((GRAPH,), weights, row), atol=1e-6
    )


def test_an_empty_graph_is_nothing() -> None:
    row = _rows(4, 1)[0]
    found = encode((GRAPH,), _graph_weights(), row)
    np.testing.assert_array_equal(found[-GRAPH.outputs :], 0)


def _all_paths(costs: np.ndarray, goal: int) -> np.ndarray:
    """Costs of the cheapest paths from all cells to a goal, as the scripted planner finds them."""
    side = len(costs)
    graph = grid_graph(costs)
    return np.asarray(dijkstra(graph, directed=False, indices=goal)).reshape(side, side)


@pytest.mark.parametrize(("side", "radius"), [(8, 1), (8, 3), (9, 4), (21, 3)])
def test_the_planner_finds_the_cheapest_ways(side: int, radius: int) -> None:
    """Against Dijkstra's search of scipy: within the rim's square, and from the rim to the goal."""
    rng, middle = np.random.default_rng(side), side // 2
    costs = np.exp(rng.uniform(-2, 3, (20, side * side))).astype(np.float32)
    goals = rng.integers(side * side, size=20)
    goals[0] = middle * (side + 1)  # Home is here.
    patches = np.zeros((20, 1, side * side), np.float32)
    patches[np.arange(20), 0, goals] = 1
    encoder = PartEncoder(
        part="map_patch", kind="planner", begin=0, shape=(1, side, side), radius=radius
    )
    found, _ = path_costs(encoder, costs, patches)
    low, high = middle - radius, middle + radius + 1
    # The rim, from straight ahead to the left and on around.
    spread = np.arange(-radius, radius + 1)
    rows = np.concatenate((0 * spread - radius, spread, 0 * spread + radius, -spread))
    columns = np.concatenate((-spread, 0 * spread - radius, spread, 0 * spread + radius))
    rim = list(dict.fromkeys(zip(rows + middle, columns + middle, strict=True)))
    rim = rim[radius:] + rim[:radius]
    for i in range(20):
        square = costs[i].reshape(side, side).astype(np.float64)
        to_goal = _all_paths(square, goals[i])
        inner = square[low:high, low:high]
        from_middle = np.full((side, side), np.inf)
        from_middle[low:high, low:high] = _all_paths(inner, len(inner) ** 2 // 2)
        expected = (from_middle + to_goal)[tuple(np.transpose(rim))]
        np.testing.assert_allclose(found[i], expected, rtol=1e-6)
        if max(abs(goals[i] // side - middle), abs(goals[i] % side - middle)) > radius:
            np.testing.assert_allclose(found[i].min(), to_goal[middle, middle], rtol=1e-6)


def test_a_planner_learns_by_the_exact_gradient() -> None:
    """Against differences of the outputs between weights that are a little apart."""
    (encoder,), rows = ENCODERS["planner"], torch.from_numpy(_rows(5, 6)).double()
    module: Any = PartsExtractor(Box(-1, 1, (LENGTH,), np.float32), (encoder,)).double()
    for parameter in module.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    slopes = torch.from_numpy(
        np.random.default_rng(2).normal(size=(len(rows), module.features_dim))
    )
    (module(rows) * slopes).sum().backward()
    for parameter in module.parameters():
        for place in np.ndindex(*parameter.shape):
            sums = []
            for step in (1e-6, -1e-6):
                with torch.no_grad():
                    parameter[place] += step
                    sums.append(float((module(rows) * slopes).sum()))
                    parameter[place] -= step
            found = float(parameter.grad[place])
            assert found == pytest.approx((sums[0] - sums[1]) / 2e-6, rel=1e-4, abs=1e-6)


def test_a_planner_begins_with_the_costs_of_its_plan() -> None:
    (encoder,) = ENCODERS["planner"]
    module: Any = PartsExtractor(Box(-1, 1, (LENGTH,), np.float32), (encoder,))
    costs = (8.0, 0.5, 1.0)
    set_planner_costs(module, costs)
    planner = module.parts["map_patch"]
    for shown in np.ndindex(2, 2, 2):  # Nothing costs 1; all else multiplies it.
        numbers = torch.tensor([1.0 if each else -1.0 for each in shown])
        found = (planner.cost_weight @ numbers + planner.cost_bias).exp().item()
        factors = [cost for cost, each in zip(costs, shown, strict=True) if each]
        assert found == pytest.approx(np.prod(factors))


def test_an_untrained_planner_heads_straight_for_the_goal() -> None:
    weights = {
        "map_patch.cost_weight": np.zeros(1, np.float32),
        "map_patch.cost_bias": np.zeros(1, np.float32),
        "map_patch.log_temperature": np.zeros(1, np.float32),
    }
    encoder = PartEncoder(part="map_patch", kind="planner", begin=0, shape=(1, 11, 11), radius=2)
    for turn, (row, column) in enumerate(((0, 5), (0, 0), (5, 0), (10, 0), (10, 5), (10, 10))):
        patch = np.full((11, 11), -1, np.float32)
        patch[row, column] = 1
        found = encode((encoder,), weights, patch.ravel())
        assert found[:-1].argmax() == 2 * turn, f"an eighth of a turn to the left, {turn} times"
        assert found[:-1].sum() == pytest.approx(1)


def _graph_weights() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in GRAPH.shapes.items()}


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"kind": "pool"}, "kind"),
        ({"shape": (2, 9)}, "shape"),
        ({"shape": (9, 10**4, 10**4)}, "shape"),
        ({"filters": (0,)}, "filters"),
        ({"filters": (1,) * 9}, "filters"),
        ({"begin": -1}, "begin"),
        ({"kind": "attention", "shape": (3, 9), "places": 4, "units": 2, "heads": 1}, "places"),
        ({"kind": "attention", "shape": (3, 9), "places": 2, "units": 0, "heads": 1}, "units"),
        ({"kind": "attention", "shape": (3, 2), "places": 2, "units": 1, "heads": 1}, "shape"),
        ({"kind": "planner", "shape": (2, 9, 8), "radius": 1}, "shape"),
        ({"kind": "planner", "goal": 2, "radius": 1}, "goal"),
        ({"kind": "planner", "radius": 0}, "radius"),
        ({"kind": "planner", "radius": 5}, "radius"),
    ],
)
def test_what_is_no_encoder_is_refused(changes: dict[str, Any], field: str) -> None:
    fields: dict[str, Any] = {"part": "map_patch", "kind": "convolution", "begin": 0}
    fields |= {"shape": (2, 9, 9), "filters": (4,)}
    with pytest.raises(InputError, match=rf"PartEncoder\.{field}: "):
        PartEncoder(**fields | changes)


def test_encoders_lie_in_the_observation() -> None:
    fields: dict[str, Any] = {"layers": (), "activation": "tanh", "outputs": 3}
    for encoders, length in (((PATCH,), 200), ((GRAPH, PATCH), LENGTH), ((PATCH, PATCH), LENGTH)):
        with pytest.raises(InputError, match=r"NetworkConfig\.encoders"):
            NetworkConfig(inputs=length, encoders=encoders, **fields)


SEES_MAP: dict[str, Any] = {
    "task": "Albot/HomingByMap-v0",
    "policy": {"kind": "multi_input", "filters": [2, 2], "graph_units": 4, "graph_heads": 2},
    "env": {
        "mapper": "albot1",
        "config": {
            "claims": False,
            "observations": {
                "laser_sectors": 12,
                "parts": ["laser", "home", "map_patch", "place_graph"],
                "map_patch": {"sides": [16.0], "cells": 8, "channels": ["walls", "trail"]},
                "place_graph": {"places": 4, "connections": 4},
            },
        },
    },
}


PLANNED = ["walls", "trail", "home"]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_agent_that_sees_its_map_is_trained_and_drives(tmp_path: Path, algorithm: str) -> None:
    tiny = TINY if algorithm in ON_POLICY else off_policy(algorithm)
    folder, plan = begun(tmp_path, deep_merge(tiny, SEES_MAP), algorithm=algorithm)
    run = TrainingRun(folder, plan)
    run.run()
    file = read_agent(folder.last)
    assert [encoder.part for encoder in file.network.encoders] == ["map_patch", "place_graph"]
    assert file.network.encoders[0].shape == (2, 8, 8)
    name = str(folder.last)
    outing = OutwardJourneyConfig(shortest=1.0, longest=2.0, away=0.0)
    settings = find_agent(name).environment(plan.task, {"config": HomingByMapConfig(outing=outing)})
    env = gymnasium.make(plan.task, world="square-loop", **settings)
    agent = make_agent(name, EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 3)
    answer = choose_action(agent, observation, info)
    expected, _ = run.learner.predict(observation, deterministic=True)
    np.testing.assert_allclose(answer, expected, atol=1e-5)
    for mapper in ("none", "odometry"):
        with pytest.raises(InputError, match=f"mapper: expected one that shows .* found {mapper}"):
            find_agent(name).environment(plan.task, {"mapper": mapper})


def test_an_agent_that_plans_over_its_map_is_trained_and_drives(tmp_path: Path) -> None:
    """By PPO and the clone of `patch-homing`: what the cells cost is learnt by both."""
    changes = {
        "policy": {"kind": "planner", "planner_radius": 2, "planner_costs": [9.0, 0.5, 1.0]},
        "pretrain": {"agent": "patch-homing", "steps": 64, "n_envs": 2, "n_epochs": 2},
        "env": {"config": {"observations": {"map_patch": {"channels": PLANNED}}}},
    }
    sees = deep_merge(TINY, {name: SEES_MAP[name] for name in ("task", "env")})
    folder, plan = begun(tmp_path, deep_merge(sees, changes))
    run = TrainingRun(folder, plan)
    run.run()
    file = read_agent(folder.last)
    (encoder,) = file.network.encoders
    assert (encoder.kind, encoder.goal, encoder.radius) == ("planner", 2, 2)
    learnt = file.weights["map_patch.cost_weight"] - 0.5 * np.log((9.0, 0.5, 1.0))
    assert (np.abs(learnt) > 1e-4).all()
    assert np.abs(learnt).max() < 0.3
    observation = np.linspace(-1, 1, file.network.inputs, dtype=np.float32)
    expected, _ = run.learner.predict(observation, deterministic=True)
    found = np.clip(Network(file.network, file.weights)(observation), -1, 1)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    card, *_ = write_card(file, "planner", tmp_path / "planner.md")
    (row,) = (line for line in card.read_text().splitlines() if "learnt cost" in line)
    assert re.fullmatch(r".*\| walls × \d\.\d\d, trail × .*, home × .*; of an unknown .* \|", row)


@pytest.mark.parametrize(
    ("patch", "policy", "expected"),
    [
        ({"channels": ["walls"]}, {}, r"kind: expected .*the channel home, found planner, 1"),
        ({"sides": [8.0, 16.0]}, {}, r"kind: expected .*one square .*, found planner, 2 squares"),
        ({}, {"planner_radius": 4}, r"planner_radius: expected at most 3, .* found 4"),
        ({}, {"planner_costs": [9, 1]}, r"planner_costs: expected 3 numbers, .*, found 2"),
    ],
)
def test_a_planner_needs_one_square_that_shows_home(
    tmp_path: Path, patch: dict[str, Any], policy: dict[str, Any], expected: str
) -> None:
    shown = {"sides": [16.0], "cells": 8, "channels": PLANNED} | patch
    seen = {"parts": ["laser", "home", "map_patch"], "map_patch": shown}
    with pytest.raises(InputError, match=expected):
        begun(
            tmp_path,
            policy={"kind": "planner"} | policy,
            env={"mapper": "albot1", "config": {"observations": seen}},
        )


def test_where_there_is_nothing_to_encode_that_is_said(tmp_path: Path) -> None:
    for kind, part in (("cnn", "map_patch"), ("attention", "place_graph")):
        expected = rf"kind: expected mlp, or observations with the part {part}.*found {kind} and"
        with pytest.raises(InputError, match=expected):
            begun(
                tmp_path,
                policy={"kind": kind},
                env={"config": {"observations": {"parts": ["laser", "home"]}}},
            )
