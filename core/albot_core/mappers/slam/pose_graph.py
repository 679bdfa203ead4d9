"""The pose graph and its optimum, by GTSAM.

G. Grisetti, R. Kümmerle, C. Stachniss and W. Burgard, A tutorial on graph-based SLAM, IEEE
Intelligent Transportation Systems Magazine 2(4), 2010: nodes are poses, edges what was measured
between two of them. Loop closures may be false. So their errors count by robust functions, and a
closure that contradicts all others loses its weight (P. Agarwal, G. Tipaldi, L. Spinello, C.
Stachniss and W. Burgard, Robust map optimization using dynamic covariance scaling, ICRA 2013).

Nothing is kept of the optimiser between two calls: what it returns follows from the graph alone.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel


class PoseGraph:
    """Poses, and what was measured between them.

    Args:
        cauchy: Width of the first robust function, by Cauchy, in standard deviations.
        dcs: Width of the second, dynamic covariance scaling, in squared standard deviations.
    """

    def __init__(self, cauchy: float, dcs: float) -> None:
        self._widths = cauchy, dcs
        self.poses: list[Pose] = []
        """The poses as believed; the first is the map's frame."""
        self.ends: list[tuple[int, int]] = []
        """Source and target of each edge."""
        self.motions: list[Pose] = []
        """The target seen from the source, of each edge."""
        self.information: list[Float64[np.ndarray, "3 3"]] = []
        """The inverse covariance of each edge's motion, along the target's own axes."""
        self.closes: list[bool] = []
        """Whether each edge is a loop closure, which may be false."""
        self._variances = np.empty((64, 2))
        self._ends = np.empty((64, 2), np.int32)
        # The ends of edges (2 edge + side) at each pose, as chains: the first, and each one's next.
        self._first = np.full(64, -1, np.int32)
        self._next = np.empty((64, 2), np.int32)
        self._edge_between: dict[tuple[int, int], int] = {}
        self._factors: list[Any] = []

    def add(
        self,
        source: int,
        target: int,
        motion: Pose,
        information: Float64[np.ndarray, "3 3"],
        *,
        closes: bool,
    ) -> None:
        """Add what was measured between two poses.

        Args:
            source: Number of the pose from which it was measured.
            target: Number of the pose that was measured, a later one.
            motion: The target seen from the source.
            information: The inverse of its covariance, along the target's own axes.
            closes: Whether it is a loop closure, and may be false.
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
        self._edge_between[source, target] = number
        self.ends.append((source, target))
        self.motions.append(motion)
        self.information.append(information)
        self.closes.append(closes)

    def optimum(self) -> Poses:
        """The likeliest poses, searched from those believed (Levenberg-Marquardt).

        First by the first kernel, whose error still pulls from afar, then from there by the second,
        which gives closures that contradict the others no weight at all.
        """
        import gtsam

        values = gtsam.Values()
        for number, pose in enumerate(self.poses):
            values.insert(number, gtsam.Pose2(*pose.tolist()))
        settings = gtsam.LevenbergMarquardtParams()
        settings.setMaxIterations(30)
        for factors, tolerance in zip(self._factor_graphs(), (1e-2, 1e-4), strict=True):
            settings.setRelativeErrorTol(tolerance)
            values = gtsam.LevenbergMarquardtOptimizer(factors, values, settings).optimize()
        return np.asarray(gtsam.utilities.extractPose2(values), np.float64)

    def _factor_graphs(self) -> list[Any]:
        """The graph as GTSAM has it, by each kernel, with the edges added since."""
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
        """All but what GTSAM holds, which is made again from the edges."""
        return self.__dict__ | {"_factors": []}

    def spreads(self, node: int) -> tuple[Float64[np.ndarray, "poses"], Int64[np.ndarray, "poses"]]:
        """How unsure the positions of all poses are, seen from one.

        By the surest path of edges (E. Olson, Recognizing places using spectrally clustered local
        matches, Robotics and Autonomous Systems 57, 2009: the Dijkstra projection). A turn's error
        counts at a lever of `LEVER` here, and as it is in `deviations`.

        Returns:
            The variance along the path (m²), and the pose before each on it, negative for none.
        """
        count, size = len(self.ends), len(self.poses)
        far, before = np.full(size, np.inf), np.full(size, -1)
        weights = self._variances[:count] @ (1.0, LEVER**2)
        find_surest_paths(self._ends[:count], weights, self._next, self._first, node, far, before)
        return far, before

    def deviations(
        self, node: int, other: int, before: Int64[np.ndarray, "poses"]
    ) -> tuple[float, float]:
        """Standard deviations of a pose seen from another: position (m), heading (rad).

        Args:
            node: The pose from which `spreads` was asked.
            other: The other pose.
            before: What `spreads` returned.
        """
        path = [other]
        while path[-1] != node:
            path.append(int(before[path[-1]]))
        known = self._edge_between
        position = heading = 0.0
        for one, next_one in pairwise(path):
            edge = known[min(one, next_one), max(one, next_one)]
            slip, turn = self._variances[edge].tolist()
            away = self.poses[one][:2] - self.poses[other][:2]
            position += slip + turn * float(away @ away)
            heading += turn
        return math.sqrt(position), math.sqrt(heading)


LEVER = 5.0
"""A turn's error moves what is so far away (m)."""


@kernel(arrays=True)
def invert_symmetric(matrix: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric 3 by 3 matrix, to the last bit symmetric as well."""
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
    before: np.ndarray,
) -> None:
    """Find the paths of least weight from one pose to all others.

    By a queue of poses whose neighbours are to be looked at (again): the graph is a chain with some
    shortcuts, in which few poses enter it twice.

    Args:
        ends: Source and target of each edge (edges, 2).
        weights: The edges' weights (edges,), none negative.
        following: The next end of an edge at the same pose, as 2 edge + side; -1 for none.
        first: The first end at each pose.
        start: The pose that the paths begin at.
        far: Infinity; filled in with the weights of the paths (poses,).
        before: -1; filled in with the pose before each on its path.
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
                far[other], before[other] = reached, pose
                if not is_waiting[other]:
                    is_waiting[other] = True
                    queue[tail] = other
                    tail = (tail + 1) % (size + 1)
            end = following[edge, side]
