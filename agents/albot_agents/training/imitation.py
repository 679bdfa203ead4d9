"""Imitation: a network learns to act as a scripted agent does.

This is DAgger (Ross, Gordon and Bagnell, A reduction of imitation learning and structured
prediction to no-regret online learning, AISTATS 2011). In the first round the teacher drives, which
is behaviour cloning. Later the learner drives most of the robots, so that it also sees the states
that its own mistakes lead to; the teacher says at each step what it would do.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float32
from torch import Tensor, nn
from torch.nn import functional

from albot_agents.training.teachers import Observations

Actions = Float32[np.ndarray, "robots numbers"]

SECTORS = 36
"""Number of sectors into which the laser's beams are pooled: of each, the nearest range."""
_PATCH = "map_patch"
_BEAMS = ("laser", "frontier")
COMMANDS = np.array(
    [(speed, turn) for speed in np.linspace(0, 1, 5) for turn in np.linspace(-1, 1, 13)], np.float32
)
"""Speed and turn rate of the ways to drive among which the network chooses."""
_TEMPERATURE = 0.5
"""Noise of the choice: the most probable command alone may turn to and fro forever."""
_BATCH = 128
_LEARNING_RATE = 1e-3


class Imitator:
    """A network that is trained to act as others did.

    `map_patch` is seen by a small convolutional network; the other parts enter as they are. What it
    learns is which of `COMMANDS` is nearest, because the mean of a turn to the left and one to the
    right is neither, and what the agent says; both by cross-entropy.

    Args:
        shapes: Shapes of the observed parts.
        numbers: Length of an action: speed, turn rate, and statements.
        seed: Seed of the initial weights and of the order of the examples.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]], numbers: int, seed: int) -> None:
        self._parts = [part for part in shapes if part != _PATCH]
        generator = torch.random.manual_seed(seed)
        self._rng = np.random.default_rng(generator.initial_seed())
        plain = sum(SECTORS if p in _BEAMS else int(np.prod(shapes[p])) for p in self._parts)
        self._eye = nn.Sequential()
        if _PATCH in shapes:
            self._eye = _convolutions(shapes[_PATCH])
            with torch.no_grad():
                plain += self._eye(torch.zeros(1, *shapes[_PATCH])).shape[1]
        self._trunk = nn.Sequential(
            nn.Linear(plain, 128),
            nn.ReLU(),
            nn.Linear(128, 128),
            nn.ReLU(),
            nn.Linear(128, len(COMMANDS) + numbers - 2),
        )
        weights = [*self._eye.parameters(), *self._trunk.parameters()]
        self._optimizer = torch.optim.Adam(weights, lr=_LEARNING_RATE)
        self._examples: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def act(self, observations: Observations) -> Actions:
        """Return the actions for observations of several robots."""
        with torch.no_grad():
            answer = self._outputs(*self._inputs(observations)).numpy()
        # The largest of logits with Gumbel noise is a sample of their softmax.
        noise = _TEMPERATURE * self._rng.gumbel(size=(len(answer), len(COMMANDS)))
        driving = COMMANDS[(answer[:, : len(COMMANDS)] + noise).argmax(axis=1)]
        return np.concatenate((driving, np.sign(answer[:, len(COMMANDS) :])), axis=1)

    def remember(self, observations: Observations, actions: Actions) -> None:
        """Keep examples: what was observed, and the actions to be learnt."""
        plain, patch = self._inputs(observations)
        # As bytes, because patches of many examples would fill the memory.
        self._examples.append((plain, np.round(127 * patch).astype(np.int8), actions))

    def learn(self, updates: int) -> None:
        """Make some updates of the weights, each with a batch drawn from all examples."""
        plain, patch, actions = (
            np.concatenate(column) for column in zip(*self._examples, strict=True)
        )
        self._examples = [(plain, patch, actions)]
        for _ in range(updates):
            rows = self._rng.integers(len(actions), size=_BATCH)
            outputs = self._outputs(plain[rows], patch[rows].astype(np.float32) / 127)
            loss = _loss(outputs, torch.from_numpy(actions[rows]))
            self._optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            self._optimizer.step()

    def _inputs(self, observations: Observations) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers for the trunk, and the patches."""
        robots = len(next(iter(observations.values())))
        plain = [
            _sectors(observations[part]) if part in _BEAMS else observations[part]
            for part in self._parts
        ]
        rows = np.concatenate([part.reshape(robots, -1) for part in plain], axis=1)
        return rows, observations.get(_PATCH, np.empty((robots, 0), np.float32))

    def _outputs(self, plain: np.ndarray, patch: np.ndarray) -> Tensor:
        seen = self._eye(torch.from_numpy(patch))
        outputs: Tensor = self._trunk(torch.cat((torch.from_numpy(plain), seen), dim=1))
        return outputs


def _convolutions(shape: tuple[int, ...]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in ((shape[0], 8), (8, 16), (16, 16)):
        layers += [nn.Conv2d(inputs, outputs, 3, stride=2, padding=1), nn.ReLU()]
    return nn.Sequential(*layers, nn.Flatten())


def _sectors(
    beams: Float32[np.ndarray, "robots beams"],
) -> Float32[np.ndarray, "robots sectors"]:
    """Return the nearest range of each sector; near is high on the scale of ranges."""
    begins = np.linspace(0, beams.shape[1], SECTORS, endpoint=False).astype(int)
    return np.asarray(np.maximum.reduceat(beams, begins, axis=1))


def _loss(outputs: Tensor, actions: Tensor) -> Tensor:
    nearest = torch.cdist(actions[:, :2], torch.from_numpy(COMMANDS)).argmin(dim=1)
    said = (actions[:, 2:] > 0).to(outputs.dtype)
    driving = functional.cross_entropy(outputs[:, : len(COMMANDS)], nearest)
    return driving + functional.binary_cross_entropy_with_logits(outputs[:, len(COMMANDS) :], said)
