"""The pose graph and its optimisation with GTSAM.

G. Grisetti, R. Kümmerle, C. Stachniss and W. Burgard, A tutorial on graph-based SLAM, IEEE
Intelligent Transportation Systems Magazine 2(4), 2010: nodes are poses, edges are measured relative
poses. Loop closures may be false, so their errors count by robust kernels, and a closure that
contradicts all others loses its weight (P. Agarwal, G. Tipaldi, L. Spinello, C. Stachniss and
W. Burgard, Robust map optimization using dynamic covariance scaling, ICRA 2013).

The optimiser keeps nothing between two calls: its result follows from the graph alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Float64, Int32

from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.stored import Stored


def _check_edges(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless edges lead forwards, a chain of them through all keyframes."""
    ends, keyframes = state["edges.ends"], sizes["keyframes"]
    expected = f"growing pairs of {keyframes} keyframes"
    refuse_unless((ends[:, 0] < ends[:, 1]).all(), "edges.ends", expected)
    chain, later = ends[~state["edges.closes"]], np.arange(1, keyframes)
    is_chain = np.array_equal(chain, np.column_stack((later - 1, later)))
    refuse_unless(is_chain, "edges.ends", "an edge from each keyframe to the next")
    is_definite = (np.linalg.eigvalsh(state["edges.information"]) > 0).all()
    refuse_unless(is_definite, "edges.information", "positive definite matrices")


class PoseGraph(Stored):
    """Poses, and the measured relative poses between them.

    Args:
        cauchy: Width of the first robust kernel, Cauchy's (standard deviations).
        dcs: Width of the second, dynamic covariance scaling (squared standard deviations).
    """

    SCHEMA = Schema(
        Field("keyframes.pose", "keyframes 3", at="poses"),
        Field("edges.ends", "edges 2", int, at="ends", least=0, below="keyframes"),
        Field("edges.motion", "edges 3", at="motions"),
        Field("edges.information", "edges 3 3", at="information"),
        Field("edges.closes", "edges", bool, at="closes"),
        rules=(_check_edges,),
    )

    def __init__(self, cauchy: float, dcs: float) -> None:
        self._widths = cauchy, dcs
        self._poses = np.empty((64, 3))
        self._count = 0
        self.ends: list[tuple[int, int]] = []
        """Source and target of each edge."""
        self.motions: list[Pose] = []
        """Pose of the target relative to the source, of each edge."""
        self.information: list[Float64[np.ndarray, "3 3"]] = []
        """The inverse covariance of each edge's motion, along the target's own axes."""
        self.closes: list[bool] = []
        """Whether each edge is a loop closure, which may be false."""
        self.closures = 0
        """Number of edges that are loop closures."""
        self._variances = np.empty((64, 2))
        self._ends = np.empty((64, 2), np.int32)
        # Linked lists of the edge ends (2 edge + side) at each pose: first end, and next of each.
        self._first = np.full(64, -1, np.int32)
        self._next = np.empty((64, 2), np.int32)
        self._factors: list[Any] = []

    @property
    def poses(self) -> Poses:
        """The estimated poses, (poses, 3); the first defines the map's frame."""
        return self._poses[: self._count]

    @poses.setter
    def poses(self, poses: Poses) -> None:
        self._poses, self._count = poses.copy(), len(poses)

    def add_pose(self, pose: Pose) -> None:
        """Add a pose with this estimate."""
        if self._count == len(self._poses):
            self._poses = np.concatenate((self._poses, np.empty((self._count + 1, 3))))
        self._poses[self._count] = pose
        self._count += 1

    def add(
        self,
        source: int,
        target: int,
        motion: Pose,
        information: Float64[np.ndarray, "3 3"],
        *,
        closes: bool,
    ) -> None:
        """Add an edge: the measured pose of the target relative to the source.

        Args:
            source: Index of the source pose.
            target: Index of the target pose, a later one.
            motion: Pose of the target relative to the source.
            information: Inverse covariance of `motion`, along the target's own axes.
            closes: Whether the edge is a loop closure, which may be false.
        """
        covariance = invert_symmetric(information)
        number = len(self.ends)
        if number == len(self._variances):
            self._variances = np.concatenate((self._variances, np.empty_like(self._variances)))
            self._ends = np.concatenate((self._ends, np.empty_like(self._ends)))
            self._next = np.concatenate((self._next, np.empty_like(self._next)))
        if target >= len(self._first):
            self._first = np.concatenate((self._first, np.full(target + 1, -1, np.int32)))
        for side, pose in enumerate((source, target)):
            self._next[number, side] = self._first[pose]
            self._first[pose] = 2 * number + side
        self._variances[number] = covariance[0, 0] + covariance[1, 1], covariance[2, 2]
        self._ends[number] = source, target
        self.ends.append((source, target))
        self.motions.append(motion)
        self.information.append(information)
        self.closes.append(closes)
        self.closures += closes

    def optimum(self) -> Poses:
        """Return the likeliest poses, searched from the estimates (Levenberg-Marquardt).

        The first search uses the first kernel, which still pulls from far away. The second starts
        from its result and uses the second kernel, which removes contradictory closures.
        """
        import gtsam

        values = gtsam.Values()
        for number, pose in enumerate(self.poses.tolist()):
            values.insert(number, gtsam.Pose2(*pose))
        settings = gtsam.LevenbergMarquardtParams()
        settings.setMaxIterations(30)
        for factors, tolerance in zip(self._factor_graphs(), (1e-2, 1e-3), strict=True):
            settings.setRelativeErrorTol(tolerance)
            values = gtsam.LevenbergMarquardtOptimizer(factors, values, settings).optimize()
        return np.asarray(gtsam.utilities.extractPose2(values), np.float64)

    def _factor_graphs(self) -> list[Any]:
        """Return the graph in GTSAM's form, once per kernel, with all new edges added."""
        import gtsam

        models = gtsam.noiseModel
        cauchy, dcs = self._widths
        kernels = (
            models.mEstimator.Cauchy.Create(cauchy),
            models.mEstimator.DCS.Create(dcs),
        )
        if not self._factors:
            fixed = models.Diagonal.Sigmas(np.full(3, 1e-4))
            self._factors = [gtsam.NonlinearFactorGraph() for _ in kernels]
            for factors in self._factors:
                factors.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(0.0, 0.0, 0.0), fixed))
        for k in range(self._factors[0].size() - 1, len(self.ends)):
            measured: Any = models.Gaussian.Information(self.information[k])
            motion = gtsam.Pose2(*self.motions[k].tolist())
            for factors, robust in zip(self._factors, kernels, strict=True):
                noise = models.Robust.Create(robust, measured) if self.closes[k] else measured
                factors.add(gtsam.BetweenFactorPose2(*self.ends[k], motion, noise))
        return self._factors

    def __getstate__(self) -> dict[str, Any]:
        """Return all but GTSAM's data, which are made again from the edges."""
        return self.__dict__ | {"_factors": []}

    def spreads(self, node: int) -> tuple[Float64[np.ndarray, "poses"], Int32[np.ndarray, "poses"]]:
        """Return the uncertainty of the positions of all poses, relative to one.

        Along the path of edges with the least variance (E. Olson, Recognizing places using
        spectrally clustered local matches, Robotics and Autonomous Systems 57, 2009: the Dijkstra
        projection). Heading errors count at a lever of `LEVER` here; `deviations` is exact.

        Returns:
            The variance along each path (m²), and the last edge of each path; -1 for none.
        """
        count, size = len(self.ends), self._count
        far, last = np.full(size, np.inf), np.full(size, -1, np.int32)
        weights = self._variances[:count] @ (1.0, LEVER**2)
        find_surest_paths(self._ends[:count], weights, self._next, self._first, node, far, last)
        return far, last

    def deviations(
        self, node: int, other: int, last: Int32[np.ndarray, "poses"]
    ) -> tuple[float, float]:
        """Return the standard deviations of a relative pose: position (m), heading (rad).

        Args:
            node: The pose that `spreads` was called with.
            other: The other pose.
            last: The last edges that `spreads` returned.
        """
        position, heading = add_errors(self._poses, self._ends, self._variances, last, node, other)
        return math.sqrt(position), math.sqrt(heading)

    def _restored(self, state: Arrays) -> None:
        edges = zip(self.ends, self.motions, self.information, self.closes, strict=True)
        self.ends, self.motions, self.information, self.closes = [], [], [], []
        for (source, target), motion, information, closes in edges:
            self.add(int(source), int(target), motion, information, closes=closes)


LEVER = 5.0
"""Distance at which an error of heading counts as one of position in `spreads` (m)."""


@kernel(arrays=True)
def invert_symmetric(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric 3 by 3 matrix; the result is exactly symmetric."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    one, two, three = d * f - e * e, c * e - b * f, b * e - c * d
    share = 1.0 / (a * one + b * two + c * three)
    inverse = np.empty((3, 3))
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = one, a * f - c * c, a * d - b * b
    inverse[0, 1] = inverse[1, 0] = two
    inverse[0, 2] = inverse[2, 0] = three
    inverse[1, 2] = inverse[2, 1] = b * c - a * e
    for i in range(3):
        for j in range(3):
            inverse[i, j] *= share
    return inverse


@kernel(arrays=True)
def find_surest_paths(
    ends: np.ndarray,
    weights: np.ndarray,
    following: np.ndarray,
    first: np.ndarray,
    start: int,
    far: np.ndarray,
    last: np.ndarray,
) -> None:
    """Find the paths of least weight from one pose to all others.

    Uses a queue of poses whose neighbours must be examined (again). The graph is a chain with some
    shortcuts, so few poses enter the queue twice.

    Args:
        ends: Source and target of each edge (edges, 2).
        weights: The edges' weights (edges,), not negative.
        following: The next edge end at the same pose, as 2 edge + side; -1 for none.
        first: The first edge end at each pose.
        start: The start of the paths.
        far: Infinity at first; filled in with the weights of the paths (poses,).
        last: -1 at first; filled in with the last edge of each pose's path.
    """
    size = len(far)
    queue, is_waiting = np.empty(size + 1, np.int64), np.zeros(size, np.bool_)
    head, tail = 0, 1
    queue[0], far[start] = start, 0.0
    while head != tail:
        pose = queue[head]
        head = (head + 1) % (size + 1)
        is_waiting[pose] = False
        end = first[pose]
        while end >= 0:
            edge, side = end >> 1, end & 1
            other = ends[edge, 1 - side]
            reached = far[pose] + weights[edge]
            if reached < far[other]:
                far[other], last[other] = reached, edge
                if not is_waiting[other]:
                    is_waiting[other] = True
                    queue[tail] = other
                    tail = (tail + 1) % (size + 1)
            end = following[edge, side]


@kernel()
def add_errors(
    poses: np.ndarray,
    ends: np.ndarray,
    variances: np.ndarray,
    last: np.ndarray,
    node: int,
    other: int,
) -> tuple[float, float]:
    """Return the variances of a relative pose, along the path found by `find_surest_paths`.

    Args:
        poses: The poses (poses, 3).
        ends: Source and target of each edge (edges, 2).
        variances: Variances of each edge: position (m²), heading (rad²), (edges, 2).
        last: The last edge of each path from `node`.
        node: The start of the paths.
        other: The other pose.
    """
    position = heading = 0.0
    one = other
    while one != node:
        edge = last[one]
        # An error of heading moves the other pose in proportion to its distance.
        x, y = poses[one, 0] - poses[other, 0], poses[one, 1] - poses[other, 1]
        position += variances[edge, 0] + variances[edge, 1] * (x * x + y * y)
        heading += variances[edge, 1]
        one = ends[edge, 0] + ends[edge, 1] - one
    return position, heading
