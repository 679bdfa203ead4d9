"""Policy networks that run without PyTorch, in which they were trained.

Their outputs are the same to the last bit on all processors (see `network_kernels`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from albot_agents.trained.encoders import ABSENT, LAYERS, SIZES, PartEncoder, encode
from albot_agents.trained.network_kernels import exponential, hyperbolic_tangent, multiply
from albot_core.errors import InputError
from albot_core.ranges import Range, check_fields

Units = Float32[np.ndarray, "*rows units"]
Rows = Float32[np.ndarray, "rows units"]
Outputs = Float32[np.ndarray, "rows outputs"]
CANDIDATES = ("arrivals", "mask")
"""The parts of observations that hold the candidates and which of them are present."""
DRIVEN = 2
"""Number of the first outputs that drive the robot: speed and turn rate."""
NOTHING = np.float32(-1.0)
"""Pooled value without any candidate; no activation is smaller."""

_CANDIDATES = Range("a whole number from 0 to 65536", 0.0, 65536.0, whole=True)


def _elu(values: Units) -> Units:
    return np.asarray(np.where(values > 0, values, exponential(np.minimum(values, 0)) - 1))


def _relu(values: Units) -> Units:
    return np.asarray(np.maximum(values, 0))


def _sigmoid(values: Units) -> Units:
    return np.asarray(0.5 * (1 + hyperbolic_tangent(0.5 * values)), np.float32)  # Never overflows.


_ACTIVATIONS: Mapping[str, Callable[[Units], Units]] = {
    "elu": _elu,
    "relu": _relu,
    "tanh": hyperbolic_tangent,
}


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """Architecture of a policy network: encoders, LSTM layers, hidden layers, a linear output.

    A network with candidates applies the same layers to each of them. Its observation is a row of
    numbers per candidate, followed by a mask of those present (above 0). Its outputs are the scores
    of "none of them" and of each candidate.
    """

    inputs: int
    """Length of an observation."""
    layers: tuple[int, ...]
    """Units of each hidden layer."""
    activation: str
    """Activation after each hidden layer: `tanh`, `relu` or `elu`."""
    outputs: int
    """Length of an action, or number of discrete actions."""
    lstm_size: int = 0
    """Units of each LSTM layer; 0 without LSTM layers."""
    lstm_layers: int = 0
    """Number of LSTM layers."""
    sampled: bool = False
    """Whether actions are drawn around the outputs, with the standard deviation in the array
    `action.log_std`."""
    sampled_statements: bool = True
    """With `sampled`: whether the numbers after speed and turn rate are drawn, too."""
    candidates: int = 0
    """Largest number of candidates in an observation; 0 for a network without candidates."""
    encoders: tuple[PartEncoder, ...] = ()
    """The encoders, of one part each, in the order of the observation."""
    squashed: bool = False
    """Whether the outputs go through tanh, as the mean actions of SAC do."""

    def __post_init__(self) -> None:
        check_fields(self, SIZES, "inputs", "outputs")
        check_fields(self, LAYERS, "lstm_layers")
        if any(units not in SIZES for units in self.layers) or len(self.layers) not in LAYERS:
            raise InputError("NetworkConfig.layers", "8 sizes at most", str(self.layers))
        if self.lstm_size not in (SIZES if self.lstm_layers else (0,)):
            expected = "a size above 0 with LSTM layers, 0 without"
            raise InputError("NetworkConfig.lstm_size", expected, str(self.lstm_size))
        if self.activation not in _ACTIVATIONS:
            expected = f"one of {', '.join(_ACTIVATIONS)}"
            raise InputError("NetworkConfig.activation", expected, self.activation)
        if self.squashed and self.sampled:
            raise InputError("NetworkConfig.sampled", "false with squashed outputs", "true")
        self._check_candidates()
        self._check_encoders()

    def _check_candidates(self) -> None:
        """Raise InputError unless inputs and outputs fit the candidates."""
        check_fields(self, _CANDIDATES, "candidates")
        if not self.candidates:
            return
        row, rest = divmod(self.inputs, self.candidates)
        if rest or row < 2:
            expected = f"at least 2 numbers for each of {self.candidates} candidates"
            raise InputError("NetworkConfig.inputs", expected, str(self.inputs))
        if self.outputs != self.candidates + 1:
            expected = f"{self.candidates + 1}, one more than the candidates"
            raise InputError("NetworkConfig.outputs", expected, str(self.outputs))
        if self.lstm_layers:
            found = str(self.lstm_layers)
            raise InputError("NetworkConfig.lstm_layers", "0 with candidates", found)
        if self.sampled:
            raise InputError("NetworkConfig.sampled", "false with candidates", "true")

    def _check_encoders(self) -> None:
        """Raise InputError unless the encoders' parts lie in the observation, one after another."""
        end = 0
        for encoder in self.encoders:
            if encoder.begin < end:
                expected = f"parts one after another, this one from {end}"
                raise InputError("NetworkConfig.encoders", expected, str(encoder.begin))
            end = encoder.begin + encoder.size
        if end > self.inputs:
            expected = f"parts that end at {self.inputs} at most"
            raise InputError("NetworkConfig.encoders", expected, str(end))
        if self.encoders and self.candidates:
            found = str(len(self.encoders))
            raise InputError("NetworkConfig.encoders", "none with candidates", found)

    @property
    def width(self) -> int:
        """Number of inputs of the first layer after the encoders."""
        if self.candidates:
            return self.inputs // self.candidates - 1
        return self.inputs + sum(encoder.outputs - encoder.size for encoder in self.encoders)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the network's arrays, by name."""
        shapes: dict[str, tuple[int, ...]] = {}
        for encoder in self.encoders:
            shapes |= encoder.shapes
        width, size = self.width, self.lstm_size
        for k in range(self.lstm_layers):
            shapes |= {
                f"lstm{k}.input": (4 * size, width),
                f"lstm{k}.hidden": (4 * size, size),
                f"lstm{k}.bias": (4 * size,),
            }
            width = size
        for k, units in enumerate(self.layers):
            shapes |= {f"layer{k}.weight": (units, width), f"layer{k}.bias": (units,)}
            width = units
        outputs = 2 if self.candidates else self.outputs  # Scores of "none" and "this one".
        spread = {"action.log_std": (outputs,)} if self.sampled else {}
        return shapes | {"action.weight": (outputs, width), "action.bias": (outputs,)} | spread


class Network:
    """A policy network. With LSTM layers it has a state, which `reset` clears.

    The LSTM is that of Hochreiter and Schmidhuber (Long short-term memory, Neural Computation
    9(8), 1997) with forget gates. Its gates are in the order input, forget, cell, output.

    Args:
        config: The architecture.
        weights: The arrays of `config.shapes`.
    """

    def __init__(self, config: NetworkConfig, weights: Mapping[str, np.ndarray]) -> None:
        self._config = config
        self._weights = weights
        of_encoders = {name for encoder in config.encoders for name in encoder.shapes}
        self._columns = {  # The matrices of linear and LSTM layers, a row for each input.
            name: np.ascontiguousarray(array.T, np.float32)
            for name, array in weights.items()
            if array.ndim == 2 and name not in of_encoders
        }
        self._activation = _ACTIVATIONS[config.activation]
        self.reset()

    def reset(self) -> None:
        """Clear the state of the LSTM layers."""
        shape = self._config.lstm_layers, self._config.lstm_size
        self._hidden = np.zeros(shape, np.float32)
        self._cells = np.zeros(shape, np.float32)

    def __call__(
        self, observation: Float32[np.ndarray, "inputs"]
    ) -> Float32[np.ndarray, "outputs"]:
        """Return the network's outputs for the next observation."""
        if self._config.candidates:
            return self._score_candidates(observation)
        rows = encode(self._config.encoders, self._weights, observation)[np.newaxis]
        for k in range(self._config.lstm_layers):
            rows = self._lstm_step(k, rows)
        answer = self._linear("action", self._hidden_layers(rows))[0]
        return np.asarray(hyperbolic_tangent(answer) if self._config.squashed else answer)

    def sample(
        self, answer: Float32[np.ndarray, "outputs"], rng: np.random.Generator
    ) -> Float32[np.ndarray, "outputs"]:
        """Draw each number from a normal distribution whose mean is the network's output.

        Without `sampled_statements` only speed and turn rate are drawn.
        """
        spread = exponential(self._weights["action.log_std"])
        drawn = answer + spread * rng.standard_normal(len(answer), np.float32)
        if self._config.sampled_statements:
            return np.asarray(drawn)
        return np.concatenate((drawn[:DRIVEN], answer[DRIVEN:]))

    def _score_candidates(
        self, observation: Float32[np.ndarray, "inputs"]
    ) -> Float32[np.ndarray, "outputs"]:
        """Return the score of "none", from the pooled hidden units, and of each candidate."""
        candidates, width = self._config.candidates, self._config.width
        present = observation[candidates * width :] > 0
        seen = self._hidden_layers(observation[: candidates * width].reshape(candidates, width))
        pooled = np.max(seen, axis=0, where=present[:, np.newaxis], initial=NOTHING, keepdims=True)
        none, this = self._linear("action", pooled)[0, 0], self._linear("action", seen)[:, 1]
        return np.concatenate(((none,), np.where(present, this, ABSENT)))

    def _hidden_layers(self, rows: Rows) -> Outputs:
        """Return the hidden layers' output for each row."""
        for k in range(len(self._config.layers)):
            rows = self._activation(self._linear(f"layer{k}", rows))
        return rows

    def _linear(self, name: str, rows: Rows) -> Outputs:
        """Return a linear layer's output."""
        products = multiply(rows, self._columns[f"{name}.weight"])
        return np.asarray(products + self._weights[f"{name}.bias"])

    def _lstm_step(self, k: int, rows: Float32[np.ndarray, "1 inputs"]) -> Rows:
        """Advance an LSTM layer by one step; return its output (1, units)."""
        seen = multiply(rows, self._columns[f"lstm{k}.input"])
        remembered = multiply(self._hidden[k : k + 1], self._columns[f"lstm{k}.hidden"])
        gates = (seen + remembered)[0] + self._weights[f"lstm{k}.bias"]
        enter, keep, new, leave = np.split(gates, 4)
        kept = _sigmoid(keep) * self._cells[k]
        self._cells[k] = kept + _sigmoid(enter) * hyperbolic_tangent(new)
        self._hidden[k] = _sigmoid(leave) * hyperbolic_tangent(self._cells[k])
        return np.asarray(self._hidden[k : k + 1].copy())
