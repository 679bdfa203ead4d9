"""The experience map: experiences, the transitions between them, and routes over them.

Equations (1) to (11), sections 4.1 and 4.2. An experience stays active while its view is seen and
the packet of the pose cells is in its zone. A transition holds its target's pose in its source's
frame, as the odometer measured it (d_ij and θ_ij as x and y, φ_ij unwrapped), and its duration.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import CorrectionConfig, ExperienceConfig, PoseCellConfig
from albot_core.mappers.ratslam.correction import correct_all_at_once, correct_link_by_link
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.ratslam.winding import turns_of
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

FASTEST = 10.0
"""Highest speed of a transition (m/s), because stamps may stand still or run backwards."""
_MOVED = 0.05
"""The map counts as changed if an experience moved farther than this (m)."""
_STIFF = 3.0
"""Number of iterations up to which a transition is fully trusted; twice as many halve its rate."""
SCENE_TURN = math.radians(10.0)
"""Standard deviation of a heading by one scene (rad)."""


class ExperienceMap(Stored):
    """Experiences and transitions.

    Args:
        config: The zones of influence.
        cells: Parameters of the pose cells, to convert the zones to cells.
        correction: How the map is corrected.
    """

    SCHEMA = Schema(parts=("experiences", "links", "_last_of_view"))

    def __init__(
        self, config: ExperienceConfig, cells: PoseCellConfig, correction: CorrectionConfig
    ) -> None:
        self._config, self._correction = config, correction
        self._shape = cells.columns, cells.rows, cells.headings
        self._zone = config.radius / cells.cell, config.turn / cells.cell_turn
        self.experiences = Table(
            "experiences",
            Field("pose", "3"),  # In the map, heading unwrapped (m, m, rad).
            Field("shown", "3"),  # The pose when the map's version last grew.
            Field("cell", "3"),  # (x', y', θ') of eq. (1), in cells.
            Field("view", "", int),  # V of eq. (1).
            Field("turn"),  # The robot's heading seen from the view (rad).
            Field("reading", "", int),  # The reading at which it was made.
            Field("way"),  # Distance driven when the robot was last there (m).
            Field("doubt", least=0),  # The robot's doubt then, see `Position.doubt` (m).
            # The previous experience with this view, -1 for none.
            Field("same_view", "", int, least=-1, below="row"),
            # The transition by which it was first reached.
            Field("reached_by", "", int, least=-1, below="transitions"),
            # First in the list of its transitions' ends, see `ends`.
            Field("entry", "", int, least=-1, below="2*transitions"),
            Field("time", least=0, finite=False),  # Duration of the quickest way home (s).
            Field("length", least=0, finite=False),  # Length of that way (m).
            # The next experience on that way, -1 at home.
            Field("onward", "", int, least=-1, below="experiences"),
        )
        self.links = Table(
            "transitions",
            Field("source", "", int, least=0, below="experiences"),
            Field("target", "", int, least=0, below="experiences"),
            Field("motion", "3"),  # d, θ and φ: the target in the source's frame.
            Field("time", least=0),  # Shortest duration (s) of all times it was driven.
            Field("weight", least=0),  # Sum of its measurements' weights.
            Field("most", least=0),  # Largest share of the rate; smaller for long ones.
            Field("stiffness", least=0),  # Its share of the rate.
            # The next ends in the lists of source and target.
            Field("ends", "2", int, least=-1, below="2*row"),
        )
        latest = Field("experience", "", int, least=-1, below="experiences")
        self._last_of_view = Table("last_of_view", latest)

    def clear(self) -> None:
        """Forget everything."""
        for table in (self.experiences, self.links, self._last_of_view):
            table.clear()

    @property
    def count(self) -> int:
        """N_e: number of experiences."""
        return self.experiences.count

    @property
    def poses(self) -> Poses:
        """Poses of the experiences in the map, headings unwrapped (a view)."""
        return self.experiences.rows("pose")

    def knows(self, view: int) -> bool:
        """Return whether a view has an experience."""
        heads = self._last_of_view
        return 0 <= view < heads.count - 1 and bool(heads["experience"][view + 1] >= 0)

    def active(self, view: int, packet: Packet) -> int:
        """Return the experience with the most energy; -1 if none has any (eq. 10)."""
        if view + 1 >= self._last_of_view.count:
            return -1
        return most_energetic(
            self._last_of_view["experience"][view + 1],
            self.experiences["same_view"],
            self.experiences["cell"],
            (packet.x, packet.y, packet.heading),
            self._shape,
            self._zone,
            self._config.position_or_heading,
        )

    def add(
        self, pose: tuple[float, float, float], packet: Packet, view: int, turn: float, reading: int
    ) -> int:
        """Make an experience (eq. 11); return its number."""
        heads = self._last_of_view
        while heads.count <= view + 1:
            heads.append(experience=-1)
        number = self.experiences.append(
            pose=pose,
            shown=pose,
            cell=(packet.x, packet.y, packet.heading),
            view=view,
            turn=turn,
            reading=reading,
            same_view=heads["experience"][view + 1],
            reached_by=-1,
            entry=-1,
            time=0.0 if self.count == 0 else math.inf,
            length=0.0 if self.count == 0 else math.inf,
            onward=-1,
        )
        heads["experience"][view + 1] = number
        return number

    def connect(
        self,
        source: int,
        target: int,
        motion: tuple[float, float, float],
        time: float,
        bias: float,
        variance: float,
        steps: int,
    ) -> bool:
        """Learn a transition, or average it with earlier measurements of it.

        Args:
            source: The experience that the robot comes from.
            target: The experience that it is in now.
            motion: The target's pose in the source's frame, as measured.
            time: Duration (s).
            bias: The odometer's heading bias (rad/s).
            variance: Variance of the motion beyond the odometer's, as a share of that of a pose by
                one scene.
            steps: Number of iterations that it took, from 1; the more, the less it is trusted.

        Returns:
            Whether the transition is new.
        """
        links, experiences = self.links, self.experiences
        time = max(time, math.hypot(motion[0], motion[1]) / FASTEST)
        link = find_link(source, target, experiences["entry"], self._ends)
        weight = self._weight(variance, bias * time)
        is_new = link < 0
        if is_new:
            turns = 0
            if experiences["reached_by"][target] < 0 < target:
                experiences["reached_by"][target] = links.count
            else:
                turns = turns_of(source, target, motion, time, self._tree, bias)
            link = links.append(
                source=source,
                target=target,
                motion=(motion[0], motion[1], motion[2] + 2 * math.pi * turns),
                time=time,
                weight=weight,
                most=min(1.0, _STIFF / steps),
                stiffness=min(1.0, weight) * min(1.0, _STIFF / steps),
                ends=(experiences["entry"][source], experiences["entry"][target]),
            )
            experiences["entry"][source] = 2 * link
            experiences["entry"][target] = 2 * link + 1
        else:
            known = links["motion"][link]
            links["weight"][link] += weight
            links["stiffness"][link] = min(1.0, links["weight"][link]) * links["most"][link]
            off = np.asarray(motion) - known
            off[2] -= 2 * math.pi * round(off[2] / (2 * math.pi))
            known += off * weight / links["weight"][link]
            links["time"][link] = min(links["time"][link], time)
        shorten(link, self._home_ways, self._graph, np.zeros(self.count, np.int64))
        return is_new

    def _weight(self, variance: float, excess: float) -> float:
        """Return the weight of a measurement: 1 if its variance is the odometer's alone.

        That variance, as a share of that of a pose by one scene, is `recognised`, and grows with
        the square of `excess`, the turn that the odometer's bias adds.
        """
        own = self._correction.recognised + (excess / SCENE_TURN) ** 2
        return own / (own + variance)

    def correct(self) -> bool:
        """Move the experiences towards where the links put them (eq. 12 to 14).

        Returns:
            Whether one has moved far enough for the map to be drawn again.
        """
        links, config = self.links, self._correction
        arrays = links["source"], links["target"], links["motion"]
        for _ in range(config.passes):
            if config.form == "link_by_link":
                correct_link_by_link(
                    self.poses, arrays, links.count, config.rate, links["stiffness"]
                )
            else:
                correct_all_at_once(
                    self.poses,
                    arrays,
                    links.count,
                    config.rate,
                    np.empty((self.count, 4)),
                    config.form == "all_at_once_limited",
                )
        if not config.passes or not has_moved(self.poses, self.experiences.rows("shown"), _MOVED):
            return False
        self.experiences.rows("shown")[:] = self.poses
        return True

    def ways_to(
        self, goal: int
    ) -> tuple[Float64[np.ndarray, "all"], Float64[np.ndarray, "all"], Int64[np.ndarray, "all"]]:
        """Return the quickest ways from all experiences to one.

        Returns:
            Time (s), length (m) and the next experience of each way, -1 at the goal and where no
            way is known.
        """
        times, lengths = np.full(self.count, np.inf), np.full(self.count, np.inf)
        onward = np.full(self.count, -1)
        times[goal] = lengths[goal] = 0.0
        queue = np.zeros(self.count, np.int64)
        spread_ways(goal, (times, lengths, onward), self._graph, queue)
        return times, lengths, onward

    def nearest(self, x: float, y: float) -> int:
        """Return the experience nearest to a point of the map (m)."""
        return int(np.argmin(np.hypot(self.poses[:, 0] - x, self.poses[:, 1] - y)))

    @property
    def _ends(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.links["source"], self.links["target"], self.links["ends"]

    @property
    def _tree(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        links = self.links
        return self.experiences["reached_by"], links["source"], links["motion"], links["time"]

    @property
    def _graph(self) -> Graph:
        links = self.links
        return (*self._ends, links["time"], links["motion"], self.experiences["entry"])

    @property
    def _home_ways(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        table = self.experiences
        return table["time"], table["length"], table["onward"]


Graph = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Sources, targets, ends, times and motions of the links; first ends of the experiences."""
Ways = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of each experience: time (s) and length (m) of its way, and the next experience on it."""


@kernel()
def most_energetic(
    last: int,
    same_view: np.ndarray,
    cells: np.ndarray,
    packet: tuple[float, float, float],
    shape: tuple[int, int, int],
    zone: tuple[float, float],
    either: bool,
) -> int:
    """Return the experience of a view with the most energy above 0; -1 if there is none."""
    found, most = -1, 0.0
    i = last
    while i >= 0:  # Eq. (8): E_V is 1 for these, and 0 for all others.
        x = _apart(packet[0], cells[i, 0], shape[0])
        y = _apart(packet[1], cells[i, 1], shape[1])
        r = math.sqrt(x * x + y * y)  # Eq. (2).
        turn = _apart(packet[2], cells[i, 2], shape[2])  # Eq. (5).
        near = 0.0 if r > zone[0] else 1.0 - r / zone[0]  # Eq. (3), (4).
        aligned = 0.0 if turn > zone[1] else 1.0 - turn / zone[1]  # Eq. (6), (7).
        # Eq. (9), but in both zones unless `either`.
        energy = near + aligned if either or (near > 0.0 and aligned > 0.0) else 0.0
        if energy > most:
            found, most = i, energy
        i = same_view[i]
    return found


@kernel()
def _apart(one: float, other: float, length: int) -> float:
    """Return the distance of two positions along an axis that wraps round."""
    apart = abs(one - other)
    return min(apart, length - apart)


@kernel()
def find_link(
    source: int, target: int, entry: np.ndarray, ends: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> int:
    """Return the link from one experience to another; -1 if there is none."""
    sources, targets, following = ends
    end = entry[source]
    while end >= 0:
        link = end >> 1
        if sources[link] == source and targets[link] == target:
            return int(link)
        end = following[link, end & 1]
    return -1


@kernel()
def shorten(link: int, ways: Ways, graph: Graph, queue: np.ndarray) -> None:
    """Update the ways after a link was added or became quicker."""
    sources, targets = graph[0], graph[1]
    i, j = sources[link], targets[link]
    if _shortens(j, i, link, ways, graph):
        spread_ways(j, ways, graph, queue)
    elif _shortens(i, j, link, ways, graph):
        spread_ways(i, ways, graph, queue)


@kernel()
def _shortens(i: int, j: int, link: int, ways: Ways, graph: Graph) -> bool:
    """Lead the way of `i` over a link to `j` if that is quicker; return whether it is."""
    times, lengths, onward = ways
    if not times[j] + graph[3][link] < times[i]:
        return False
    x, y = graph[4][link, 0], graph[4][link, 1]
    times[i] = times[j] + graph[3][link]
    lengths[i] = lengths[j] + math.sqrt(x * x + y * y)
    onward[i] = j
    return True


@kernel()
def spread_ways(start: int, ways: Ways, graph: Graph, queue: np.ndarray) -> None:
    """Update all ways that become quicker by leading over an experience.

    This is label correcting with a first-in, first-out queue. `queue` (experiences,) must be zeros;
    it holds the next experience in the queue of each, plus one.
    """
    sources, targets, following, entry = graph[0], graph[1], graph[2], graph[5]
    first = last = start
    queue[start] = start + 1  # The last one in the queue points to itself.
    while first >= 0:
        i = first
        end = entry[i]
        while end >= 0:
            link = end >> 1
            j = targets[link] if end & 1 == 0 else sources[link]
            if _shortens(j, i, link, ways, graph) and queue[j] == 0:
                queue[last] = j + 1
                queue[j] = j + 1
                last = j
            end = following[link, end & 1]
        first = queue[i] - 1 if i != last else -1
        queue[i] = 0


@kernel()
def has_moved(poses: np.ndarray, before: np.ndarray, far: float) -> bool:
    """Return whether any pose has moved farther than `far` (m)."""
    for i in range(poses.shape[0]):
        x, y = poses[i, 0] - before[i, 0], poses[i, 1] - before[i, 1]
        if x * x + y * y > far * far:
            return True
    return False
