"""Encoders of parts of observations: convolutions, attention for graphs, and a planner.

`albot_agents.training.encoders` has the same in PyTorch. What no encoder takes enters a network's
first layer as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int32

from albot_agents.trained.network_kernels import (
    exponential,
    hyperbolic_tangent,
    multiply,
    softmax,
)
from albot_agents.trained.shortest_path_kernels import rim_cells, search_paths
from albot_core.errors import InputError
from albot_core.ranges import Range, check_fields

CONVOLUTION, ATTENTION, PLANNER = "convolution", "attention", "planner"
SIZES = Range("a whole number from 1 to 65536", 1.0, 65536.0, whole=True)
"""Units of a layer, and lengths of its input."""
LAYERS = Range("a whole number from 0 to 8", 0.0, 8.0, whole=True)
"""Number of layers of a kind."""
KERNEL, STRIDE, PADDING = 3, 2, 1
"""Side of a filter, step between its positions, and rim of zeros, in cells."""
ABSENT = np.float32(-1e8)
"""Score of what is absent; finite, so that PyTorch's gradients are finite."""
ENDS = slice(1, 3)
"""Columns of a connection that hold the rows of its source and target."""

LARGEST_EXPONENT = 5.0
"""Largest absolute logarithm of a cell's cost."""

_NOT_NEGATIVE = Range("a whole number from 0", 0.0, 1e9, whole=True)
_HEADS = Range("a whole number from 1 to 64", 1.0, 64.0, whole=True)

Row = Float32[np.ndarray, "inputs"]
Features = Float32[np.ndarray, "features"]
Weights = Mapping[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class PartEncoder:
    """Architecture of the encoder of one part of observations.

    A `convolution` has layers of 3 × 3 filters with stride 2, each followed by a ReLU. It takes a
    patch of the shape (channels, rows, columns).

    An `attention` pools the rows of the part `place_graph`: places, then connections. Each place is
    embedded by a layer with tanh; so is each connection, together with the two places that it
    joins, but without their numbers. Each head has a query; its output is the mean of the embedded
    rows that are present, weighted by the softmax of their products with the query. It does not
    depend on the order of the rows (Ilse, Tomczak and Welling, Attention-based deep multiple
    instance learning, ICML 2018, without their gate; the scale 1/√units is that of Vaswani et al.,
    NeurIPS 2017).

    A `planner` takes a patch of the shape (channels, rows, columns) in which one channel shows
    where to go. The logarithm of a cell's cost is a linear function of its channels, within ±5. The
    outputs are the softmax of the negated costs of the cheapest paths from the middle by each cell
    of a rim around it, divided by a temperature, from straight ahead counter-clockwise; and the
    cost c of the cheapest path as c / (c + side of the patch in cells). As in value iteration
    networks (Tamar et al., NIPS 2016) what the cells cost is learnt by the gradient of what is done
    with the outputs. Unlike theirs, the paths are exact, and so is their gradient: the derivative
    of a path's cost by a cell's is the path's length in that cell.
    """

    part: str
    """Name of the part."""
    kind: str
    """`convolution`, `attention` or `planner`."""
    begin: int
    """Where the part begins in a flat observation."""
    shape: tuple[int, ...]
    """Shape of the part."""
    filters: tuple[int, ...] = ()
    """Number of filters of each layer of a convolution."""
    places: int = 0
    """Number of rows of the graph that hold places; the others hold connections."""
    units: int = 0
    """Length of an embedded row of the graph."""
    heads: int = 0
    """Number of queries of the attention."""
    goal: int = 0
    """Index of the channel that shows a planner where to go, by its largest value."""
    radius: int = 0
    """Distance of a planner's rim from the middle (cells)."""

    def __post_init__(self) -> None:
        check_fields(self, _NOT_NEGATIVE, "begin", "places", "units", "heads", "goal", "radius")
        dimensions = {CONVOLUTION: 3, ATTENTION: 2, PLANNER: 3}.get(self.kind)
        if dimensions is None:
            expected = f"{CONVOLUTION}, {ATTENTION} or {PLANNER}"
            raise InputError("PartEncoder.kind", expected, self.kind)
        sizes_fit = all(size in SIZES for size in self.shape)
        if len(self.shape) != dimensions or not sizes_fit or self.size not in SIZES:
            expected = f"{dimensions} sizes, 65536 numbers at most"
            raise InputError("PartEncoder.shape", expected, str(self.shape))
        if self.kind == CONVOLUTION:
            if any(count not in SIZES for count in self.filters) or len(self.filters) not in LAYERS:
                raise InputError("PartEncoder.filters", "8 sizes at most", str(self.filters))
            return
        if self.kind == PLANNER:
            self._check_planner()
            return
        check_fields(self, SIZES, "units")
        check_fields(self, _HEADS, "heads")
        if not 1 <= self.places <= self.shape[0]:
            expected = f"a whole number from 1 to {self.shape[0]}"
            raise InputError("PartEncoder.places", expected, str(self.places))
        if self.shape[1] < ENDS.stop:
            raise InputError("PartEncoder.shape", "3 columns or more", str(self.shape))

    def _check_planner(self) -> None:
        """Raise InputError unless patch, goal and rim fit."""
        channels, rows, columns = self.shape
        if rows != columns:
            raise InputError("PartEncoder.shape", "a square patch", str(self.shape))
        if self.goal >= channels:
            expected = f"a whole number from 0 to {channels - 1}"
            raise InputError("PartEncoder.goal", expected, str(self.goal))
        largest = (rows - 1) // 2
        if not 1 <= self.radius <= largest:
            expected = f"a whole number from 1 to {largest}"
            raise InputError("PartEncoder.radius", expected, str(self.radius))

    @property
    def size(self) -> int:
        """Number of inputs."""
        return math.prod(self.shape)

    @property
    def joined_columns(self) -> int:
        """Number of numbers of a connection, without its ends, and of the places that it joins."""
        columns = self.shape[1]
        return 3 * columns - (ENDS.stop - ENDS.start)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        if self.kind == ATTENTION:
            return self.units * self.heads
        if self.kind == PLANNER:
            return 8 * self.radius + 1
        channels, rows, columns = self.shape
        for filters in self.filters:
            channels, rows, columns = filters, _strided(rows), _strided(columns)
        return channels * rows * columns

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the encoder's arrays, by name."""
        part = self.part
        if self.kind == ATTENTION:
            columns = self.shape[1]
            return {
                f"{part}.place.weight": (self.units, columns),
                f"{part}.place.bias": (self.units,),
                f"{part}.connection.weight": (self.units, self.joined_columns),
                f"{part}.connection.bias": (self.units,),
                f"{part}.query": (self.heads, self.units),
            }
        if self.kind == PLANNER:
            return {
                f"{part}.cost_weight": (self.shape[0],),
                f"{part}.cost_bias": (1,),
                f"{part}.log_temperature": (1,),
            }
        shapes: dict[str, tuple[int, ...]] = {}
        channels = self.shape[0]
        for k, filters in enumerate(self.filters):
            shapes[f"{part}.filter{k}.weight"] = (filters, channels, KERNEL, KERNEL)
            shapes[f"{part}.filter{k}.bias"] = (filters,)
            channels = filters
        return shapes


def encode(encoders: tuple[PartEncoder, ...], weights: Weights, observation: Row) -> Features:
    """Return the numbers that no encoder takes, in order, followed by each encoder's outputs.

    Args:
        encoders: The encoders.
        weights: The arrays of their `shapes`.
        observation: A flat observation.
    """
    plain, encoded = np.ones(len(observation), np.bool_), []
    for encoder in encoders:
        taken = slice(encoder.begin, encoder.begin + encoder.size)
        plain[taken] = False
        encoded.append(_ENCODINGS[encoder.kind](encoder, weights, observation[taken]))
    return np.concatenate((observation[plain], *encoded))


def _strided(cells: int) -> int:
    """Return the number of positions of a filter along a side."""
    return (cells + 2 * PADDING - KERNEL) // STRIDE + 1


def _convolve(encoder: PartEncoder, weights: Weights, numbers: Row) -> Features:
    image = numbers.reshape(encoder.shape)
    for k, filters in enumerate(encoder.filters):
        channels, rows, columns = image.shape
        framed = np.zeros((channels, rows + 2 * PADDING, columns + 2 * PADDING), np.float32)
        framed[:, PADDING:-PADDING, PADDING:-PADDING] = image
        rows, columns = _strided(rows), _strided(columns)
        # All positions of a filter at once: a product of matrices.
        seen = np.empty((channels, KERNEL, KERNEL, rows, columns), np.float32)
        for down in range(KERNEL):
            for right in range(KERNEL):
                cells = framed[:, down::STRIDE, right::STRIDE]
                seen[:, down, right] = cells[:, :rows, :columns]
        kernel, bias = (weights[f"{encoder.part}.filter{k}.{name}"] for name in ("weight", "bias"))
        summed = multiply(kernel.reshape(filters, -1), seen.reshape(-1, rows * columns))
        image = np.maximum(summed + bias[:, np.newaxis], 0).reshape(filters, rows, columns)
    return np.asarray(image.ravel(), np.float32)


def _attend(encoder: PartEncoder, weights: Weights, numbers: Row) -> Features:
    rows = numbers.reshape(encoder.shape)
    present = rows[:, 0] > 0
    if not present.any():
        return np.zeros(encoder.outputs, np.float32)
    places, connections = rows[: encoder.places], rows[encoder.places :]
    last = encoder.places - 1
    ends = np.clip(np.rint((connections[:, ENDS] + 1) * (max(last, 1) / 2)), 0, last).astype(int)
    own = np.delete(connections, ENDS, axis=1)
    joined = np.concatenate((own, places[ends[:, 0]], places[ends[:, 1]]), axis=1)
    embedded = hyperbolic_tangent(
        np.concatenate(
            [
                multiply(each, np.ascontiguousarray(weights[f"{encoder.part}.{name}.weight"].T))
                + weights[f"{encoder.part}.{name}.bias"]
                for name, each in (("place", places), ("connection", joined))
            ]
        )
    )
    scale = np.float32(math.sqrt(encoder.units))
    scores = multiply(weights[f"{encoder.part}.query"], np.ascontiguousarray(embedded.T)) / scale
    shares = softmax(np.where(present, scores, ABSENT))
    return np.asarray(multiply(shares, embedded).ravel())


def _plan(encoder: PartEncoder, weights: Weights, numbers: Row) -> Features:
    channels = encoder.shape[0]
    patch = numbers.reshape(channels, -1)
    weight, bias = (weights[f"{encoder.part}.cost_{name}"] for name in ("weight", "bias"))
    exponents = multiply(weight[np.newaxis], patch) + bias
    costs = exponential(np.clip(exponents, -LARGEST_EXPONENT, LARGEST_EXPONENT))
    paths = path_costs(encoder, costs, patch[np.newaxis])[0]
    shares = softmax(-paths * exponential(-weights[f"{encoder.part}.log_temperature"]))
    cheapest = paths.min()
    length = cheapest / (cheapest + encoder.shape[1])
    return np.asarray(np.append(shares, length), np.float32)


def path_costs(
    encoder: PartEncoder,
    costs: Float[np.ndarray, "patches cells"],
    patches: Float[np.ndarray, "patches channels cells"],
) -> tuple[Float64[np.ndarray, "patches rim"], Int32[np.ndarray, "patches 2 cells"]]:
    """Return the costs of a planner's paths, and the paths as `search_paths` returns them.

    Args:
        encoder: The planner.
        costs: Costs of the cells.
        patches: What the cells show.
    """
    rim = rim_cells(encoder.shape[1], encoder.radius)
    found = np.empty((len(costs), len(rim)))
    before = np.empty((len(costs), 2, costs.shape[1]), np.int32)
    goals = patches[:, encoder.goal].argmax(axis=1)
    search_paths(costs.astype(np.float64), goals, rim, encoder.radius, found, before)
    return found, before


_ENCODINGS: Mapping[str, Callable[[PartEncoder, Weights, Row], Features]] = {
    CONVOLUTION: _convolve,
    ATTENTION: _attend,
    PLANNER: _plan,
}
