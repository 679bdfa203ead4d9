"""Claims learnt as a classification, and the network that they get in an agent's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from torch import nn

from albot_agents.trained.agent_file import AgentFile, read_agent
from albot_agents.trained.encoders import CONVOLUTION, PartEncoder
from albot_agents.trained.network import Network, NetworkConfig
from albot_agents.trained.trained_agent import shipped_agents
from albot_agents.training.claims import Place, with_claims
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError
from albot_core.plain_data import deep_merge
from albot_env.tasks.explore.task import ExploreTask
from tests.agents.training.tiny import SMALL, begun, plan_file

CLAIMS = {
    "parts": ["motion"], "units": 4, "steps": 600, "n_envs": 10, "n_epochs": 60, "batch_size": 64,
    "learning_rate": 0.05,
}  # fmt: skip
EXPLORE: dict[str, Any] = deep_merge(
    SMALL,
    {
        "task": "Albot/Explore-v0",
        "n_timesteps": 32,
        "n_steps": 8,
        "batch_size": 16,
        "policy": {"net_arch": [8, 8], "sampled": True, "sampled_statements": False},
        "env": {"max_episode_steps": 40, "config": {"observations": {"laser_sectors": 4}}},
        "claims": CLAIMS,
    },
)
EXPLORE["env"].pop("journeys")
DRIVING = slice(0, 2)


def _agent(network: NetworkConfig, seed: int) -> AgentFile:
    rng = np.random.default_rng(seed)
    weights = {
        name: rng.normal(0, 0.4, shape).astype(np.float32) for name, shape in network.shapes.items()
    }
    return replace(read_agent(shipped_agents()["exploring"]), network=network, weights=weights)


def _classifier(inputs: int, layers: int, seed: int) -> nn.Sequential:
    torch.manual_seed(seed)
    parts: list[nn.Module] = []
    for _ in range(layers):
        parts += nn.Linear(inputs, 5), nn.Tanh()
        inputs = 5
    return nn.Sequential(*parts, nn.Linear(inputs, 1))


@pytest.mark.parametrize("layers", [(7,), (6, 9), (4, 4, 4)])
@pytest.mark.parametrize("encoders", [(), (PartEncoder(
    part="coverage", begin=2, shape=(1, 4, 4), kind=CONVOLUTION, filters=(3,)),)])  # fmt: skip
@pytest.mark.parametrize("said", [2, 3])
def test_the_classifier_decides_on_claims_and_nothing_else_changes(
    layers: tuple[int, ...], encoders: tuple[PartEncoder, ...], said: int
) -> None:
    network = NetworkConfig(
        inputs=24, layers=layers, activation="tanh", outputs=4, encoders=encoders
    )
    before, classifier = _agent(network, 1), _classifier(3, len(layers), 2)
    place = Place(np.array((21, 0, 19)), said, 0.5)
    after = with_claims(before, classifier, place)
    rng = np.random.default_rng(3)
    for seen in rng.uniform(-1, 1, (50, 24)).astype(np.float32):
        old = Network(before.network, before.weights)(seen)
        new = Network(after.network, after.weights)(seen)
        others = np.arange(4) != said
        assert old[others].tolist() == new[others].tolist()  # To the last bit.
        with torch.no_grad():
            odds = float(classifier(torch.from_numpy(seen[place.columns]))[0])
        assert abs(new[said] - 0.5 - odds) < 1e-5


def test_a_training_ends_with_learning_when_to_claim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a robot turns left, a claim would be right; where it turns right, false."""

    def outcomes(task: ExploreTask) -> np.ndarray:
        turns = task.observation_config.split_rows(task.observations)["motion"][:, 2]
        return np.sign(np.where(np.abs(turns) > 0.02, turns, 0)).astype(np.int64)

    monkeypatch.setattr(ExploreTask, "claim_outcomes", property(outcomes))
    folder, plan = begun(tmp_path, EXPLORE)
    figures = TrainingRun(folder, plan).run()["claims"]
    assert figures["samples"] == 600
    assert figures["precision"] > 0.9
    assert figures["recall"] > 0.5
    agent = read_agent(folder.last)
    assert agent.network.layers == (12, 12)
    network = Network(agent.network, agent.weights)
    turn = agent.observation_config.layout.motion + 2  # type: ignore[union-attr]
    seen = np.zeros(agent.network.inputs, np.float32)
    for turned, claims in ((0.5, True), (-0.5, False)):
        seen[turn] = turned
        assert bool(network(seen)[2] > 0.5) is claims
    # It drives as it did: as the last checkpoint's policy, whose own claims are gone.
    plain = deep_merge(EXPLORE, {"claims": None})
    (tmp_path / "plain").mkdir()
    other, its = begun(tmp_path / "plain", plain)
    TrainingRun(other, its).run()
    untaught = read_agent(other.last)
    without = Network(untaught.network, untaught.weights)
    assert network(seen)[DRIVING].tolist() == without(seen)[DRIVING].tolist()
    # A run that is resumed when all is done learns the same, and no network grows.
    again = RunFolder(folder.path)
    resumed = again.resume(None)
    assert TrainingRun(again, resumed).run()["claims"] == figures
    assert read_agent(folder.last).weights.keys() == agent.weights.keys()
    assert read_agent(folder.last).fingerprint == agent.fingerprint


def test_claims_of_one_kind_alone_cannot_be_learnt(tmp_path: Path) -> None:
    """Without a mapper, in the first room, all claims are false."""
    folder, plan = begun(tmp_path, EXPLORE)
    with pytest.raises(InputError, match=r"claims of both kinds in 600 samples; .* be right"):
        TrainingRun(folder, plan).run()
    assert read_agent(folder.last).network.layers == (8, 8)  # Nothing is lost.


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"claims": {"probability": 1.0}}, "probability: expected a number between 0 and 1"),
        ({"claims": {"parts": []}}, "parts: expected one part or more, each once, found none"),
        ({"claims": {"parts": ["motoin"]}}, r"claims.parts.*found motoin .did you mean motion"),
        ({"claims": {"parts": ["matches"]}}, "expected a part that is observed, and not encoded"),
        ({"claims": {"steps": 3}}, "steps: expected at least one of each environment, 10"),
        ({"claims": {"n_envs": 2}, "env": {"world": ["square-loop"] * 3}}, "claims.n_envs, 2"),
        ({"policy": {"sampled_statements": True}}, "claims: expected null, or a policy of ppo"),
        ({"policy": {"net_arch": []}}, "claims: .* found no layer in net_arch"),
        ({"algorithm": "recurrent_ppo"}, "claims: .* found recurrent_ppo"),
        (
            {"policy": {"kind": "cnn"}, "claims": {"parts": ["coverage"]}},
            "expected a part that is observed, and not encoded: laser",
        ),
        ({"env": {"config": {"claims": False}}}, "claims: expected null, or a task in which"),
    ],
)
def test_claims_that_do_not_fit_the_plan_are_refused(
    tmp_path: Path, changes: dict[str, Any], error: str
) -> None:
    with pytest.raises(InputError, match=error):
        read_plan(plan_file(tmp_path / "plan.yml", deep_merge(EXPLORE, {"n_envs": 4}), **changes))
