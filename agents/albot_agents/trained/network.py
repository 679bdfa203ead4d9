"""Policy networks in plain numpy: what was trained with PyTorch runs without it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.ranges import Range, check_fields

Row = Float32[np.ndarray, "units"]

_SIZE = Range("a whole number from 1 to 65536", 1.0, 65536.0, whole=True)
_LAYERS = Range("a whole number from 0 to 8", 0.0, 8.0, whole=True)


def _elu(values: Row) -> Row:
    return np.asarray(np.where(values > 0, values, np.expm1(np.minimum(values, 0))))


def _relu(values: Row) -> Row:
    return np.asarray(np.maximum(values, 0))


def _sigmoid(values: Row) -> Row:
    return np.asarray(0.5 * (1 + np.tanh(0.5 * values)), np.float32)  # Never overflows.


_ACTIVATIONS: Mapping[str, Callable[[Row], Row]] = {"elu": _elu, "relu": _relu, "tanh": np.tanh}


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """How a policy network is built: LSTM layers, hidden layers, and a linear one for actions."""

    inputs: int
    """Numbers in an observation."""
    layers: tuple[int, ...]
    """Units in the hidden layers."""
    activation: str
    """What follows each hidden layer: `tanh`, `relu` or `elu`."""
    outputs: int
    """Numbers of an action, or discrete actions."""
    lstm_size: int = 0
    """Units of each LSTM layer; 0 without any."""
    lstm_layers: int = 0
    """LSTM layers."""

    def __post_init__(self) -> None:
        check_fields(self, _SIZE, "inputs", "outputs")
        check_fields(self, _LAYERS, "lstm_layers")
        if any(units not in _SIZE for units in self.layers) or len(self.layers) not in _LAYERS:
            raise InputError("NetworkConfig.layers", "8 sizes at most", str(self.layers))
        if self.lstm_size not in (_SIZE if self.lstm_layers else (0,)):
            expected = "a size where there are LSTM layers, else 0"
            raise InputError("NetworkConfig.lstm_size", expected, str(self.lstm_size))
        if self.activation not in _ACTIVATIONS:
            expected = f"one of {', '.join(_ACTIVATIONS)}"
            raise InputError("NetworkConfig.activation", expected, self.activation)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The arrays of the network by name, and their shapes."""
        shapes: dict[str, tuple[int, ...]] = {}
        width, size = self.inputs, self.lstm_size
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
        return shapes | {"action.weight": (self.outputs, width), "action.bias": (self.outputs,)}


class Network:
    """A policy network that remembers, where it has LSTM layers, since it was last reset.

    The LSTM is Hochreiter and Schmidhuber's (Long short-term memory, Neural Computation 9(8),
    1997) with forget gates; its gates lie in the order input, forget, cell, output.

    Args:
        config: How it is built.
        weights: The arrays of `config.shapes`.
    """

    def __init__(self, config: NetworkConfig, weights: Mapping[str, np.ndarray]) -> None:
        self._config = config
        self._weights = weights
        self._activate = _ACTIVATIONS[config.activation]
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        shape = self._config.lstm_layers, self._config.lstm_size
        self._hidden = np.zeros(shape, np.float32)
        self._cells = np.zeros(shape, np.float32)

    def __call__(
        self, observation: Float32[np.ndarray, "inputs"]
    ) -> Float32[np.ndarray, "outputs"]:
        """The network's answer to the next observation."""
        weights, row = self._weights, observation
        for k in range(self._config.lstm_layers):
            row = self._remember(k, row)
        for k in range(len(self._config.layers)):
            row = self._activate(weights[f"layer{k}.weight"] @ row + weights[f"layer{k}.bias"])
        return np.asarray(weights["action.weight"] @ row + weights["action.bias"])

    def _remember(self, k: int, row: Float32[np.ndarray, "inputs"]) -> Float32[np.ndarray, "units"]:
        """One step of an LSTM layer."""
        weights = self._weights
        gates = weights[f"lstm{k}.input"] @ row + weights[f"lstm{k}.hidden"] @ self._hidden[k]
        enter, keep, new, leave = np.split(gates + weights[f"lstm{k}.bias"], 4)
        self._cells[k] = _sigmoid(keep) * self._cells[k] + _sigmoid(enter) * np.tanh(new)
        self._hidden[k] = _sigmoid(leave) * np.tanh(self._cells[k])
        return np.asarray(self._hidden[k].copy())
