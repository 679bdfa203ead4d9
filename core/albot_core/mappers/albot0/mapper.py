"""Albot0: a robot with eight sonars and an odometer that it does not correct.

Schmidt, Wong and Yeap. On its way out the robot makes a geometric map, which is split into absolute
space representations (ASRs). Then the robot turns round, makes a new map of the way home, and
localises itself in the ASRs of the way out: by the distance travelled in ASR lengths, and by its
turn from one ASR into the next. Both maps are inexact, and neither is ever corrected or laid over
the other. The mapper `albot0-paper` is this and no more: the robot is turned off between the two
journeys, and whatever frame its odometer then has, it knows the ASRs that it knew before.

In addition, `albot0` keeps its most likely path by odometer and echoes together (`Trail`), on which
the way home and the cue `way` rest: that is ours. It finds out by its echoes whether the odometer
still has the frame of the way out, and if not, in which frame the way home lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_segments
from albot_core.mappers.albot0.config import Albot0Config
from albot_core.mappers.albot0.geometric_map import GeometricMap
from albot_core.mappers.albot0.localisation import (
    CUES,
    Belief,
    Confidences,
    DemocraticIntegration,
    Stop,
)
from albot_core.mappers.albot0.paths import PathInProgress, side_sonars
from albot_core.mappers.albot0.state import SCHEMA, STEPS, steps_of
from albot_core.mappers.albot0.steps import NO_STEPS, Steps
from albot_core.mappers.albot0.trail import Trail
from albot_core.mappers.albot0.way_back import WayBack
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, Estimate, WayHome
from albot_core.mappers.schema import Arrays, Schema
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, SegmentsLayer
from albot_core.sensing.reading import Reading


class Albot0(StoredMapper):
    """Albot0's cognitive map, and its localisation on the way home.

    ASRs are numbered in the order of the way out: home is 0. Because the journey is split again at
    every stop, numbers may change until the robot turns round for home. The mapper remembers places
    (`PlaceMemory`), which are ASRs.

    Args:
        config: All thresholds.
        name: The name under which the mapper is registered.
    """

    config: Albot0Config

    def __init__(self, config: Albot0Config | None = None, name: str = "albot0") -> None:
        config = config or Albot0Config()
        parts = () if config.trail is None else ("_trail",)
        self.SCHEMA = Schema(*SCHEMA.fields, parts=parts, rules=SCHEMA.rules)
        super().__init__(config, name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. `rng` is used until the next reset."""
        self._rng = rng
        self._pose = np.zeros(3)
        self._readings = 0
        self._updates = 0
        self._path = PathInProgress(samples=[])
        self._out = GeometricMap(self.config.regions)
        self._trail = None if self.config.trail is None else Trail(self.config.trail, rng)
        self._home: GeometricMap | None = None
        self._was_told = False
        self._way_back: WayBack | None = None
        self._fusion = DemocraticIntegration.of(len(self.config.localisation.cues))
        self._confidences: Confidences = np.empty(0)
        self._beliefs: list[Belief] = []

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether a robot path ended, which the map then holds.

        Raises:
            InputError: The reading lacks sonars, or no sonar points to one of the sides.
        """
        sonar = reading.required_sonar(self._name)
        side_sonars(sonar.geometry)
        if self._readings:
            self._pose = compose(self._pose, reading.motion)
        number, self._readings = self._readings, self._readings + 1
        x, y, heading = self._pose.tolist()
        paths = self.config.paths
        steps = self._path.follow((x, y, heading), sonar, number, paths)
        if steps is not None:
            self._stop(steps)
        if paths.detects_return and not self._was_told and self._path.has_turned_round(paths):
            self._turn_round()
        return steps is not None

    def begin_return(self) -> None:
        """Treat the travel so far as the way out, and what follows as the way home.

        The robot may be turned off here, so that its odometer goes on in another frame: the next
        motion may be any.

        Without this call the mapper detects itself where the robot turns round (see
        `PathConfig.detects_return`), and the last detection counts. A robot that has gone nowhere
        is at home, and stays on its way out.
        """
        self.end_path()
        if self._out.regions.count:
            self._turn_round()
            self._was_told = True
            if self._trail is not None:
                self._trail.turn_round()

    def end_path(self) -> None:
        """End the robot path at the robot's position; on the way home, localise the robot.

        Without this call a path ends where the robot turns, or when it is long enough.
        """
        steps = self._path.stop(self.config.paths)
        if steps is not None:
            self._stop(steps)

    def _turn_round(self) -> None:
        """Begin the map of the way home. The robot is still in the last ASR of the way out."""
        if self._home is not None:
            self._out.extend(self._home.steps)
        self._home = GeometricMap(self.config.regions)
        self._fusion = DemocraticIntegration.of(len(self.config.localisation.cues))
        self._path.direction_before = None
        self._way_back = self._lay_out()
        self._updates += 1
        self._beliefs = []
        self._believe(np.eye(self._out.regions.count)[-1])

    def _stop(self, steps: Steps) -> None:
        """Add the path that has ended to the map; on the way home, localise the robot."""
        self._updates += 1
        if self._home is None:
            self._out.extend(steps)
        else:
            self._home.extend(steps)
        if self._trail is not None:
            self._trail.extend(steps)
        self._way_back = self._lay_out()
        if self._home is None:
            return
        stop, config = self.last_stop, self.config.localisation
        maps = np.stack([CUES[name](stop, config) for name in config.cues])
        self._believe(self._fusion.fuse(maps))

    def _lay_out(self) -> WayBack | None:
        """Return the way home from where the robot may be now; None without a trail."""
        out, trail = slice(0, len(self._out.steps.lines)), self._trail
        if trail is None:
            return None
        steps, config = trail.steps, self.config.way_back
        return WayBack(steps.part(out), steps.surfaces, trail.particles, trail.frame, config)

    def _believe(self, confidences: Confidences) -> None:
        self._confidences = confidences
        reading = max(self._readings - 1, 0)
        kept = None if self._trail is None else self._trail.kept
        self._beliefs.append(Belief.of(reading, confidences, self.config.localisation, kept))

    @property
    def last_stop(self) -> Stop:
        """The data for the cues at the last stop on the way home.

        Raises:
            InputError: The robot is on its way out.
        """
        if self._home is None:
            raise InputError("last_stop", "a robot on its way home", "one on its way out")
        beside = None if self._way_back is None else self._way_back.fit(self._out.regions)
        return Stop(out=self._out.regions, home=self._home.regions, beside=beside)

    @property
    def geometric_maps(self) -> tuple[GeometricMap, ...]:
        """The map of the way out and, once the robot has turned round, that of the way home."""
        return (self._out,) if self._home is None else (self._out, self._home)

    @property
    def is_returning(self) -> bool:
        """Whether the robot has turned round for home."""
        return self._home is not None

    @property
    def confidences(self) -> Confidences:
        """The confidence of every ASR of the way out; empty until the robot turns round."""
        return self._confidences.copy()

    @property
    def estimate(self) -> Estimate:
        """The ASR in which the robot believes to be, and its pose by the odometer.

        On the way home the robot is not localised at borders. Otherwise its reading matches one
        from the middle of its ASR.
        """
        is_sure, place, matched = True, None, None
        if self._home is not None:
            belief = self._beliefs[-1]
            is_sure, place = belief.is_sure, belief.place
            if is_sure:
                first, last = self._out.regions.splits[place : place + 2].tolist()
                matched = int(self._out.steps.readings[(first + last) // 2])
        elif self._readings:
            place = max(self._out.regions.count - 1, 0)
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3) if self._trail is None else self._trail.frame.copy(),
            localised=is_sure,
            place=place,
            matched_reading=matched,
            updates=self._updates,
            map_version=self._updates,
            segments=sum(int(each.steps.walled.sum()) for each in self.geometric_maps),
        )

    @property
    def events(self) -> Sequence[Belief]:
        """The beliefs at all stops on the way home."""
        return tuple(self._beliefs)

    def place_at(self, reading: int) -> int:
        """Return the ASR where a reading was taken; on the way home, the ASR believed then."""
        for belief in reversed(self._beliefs):
            if belief.reading <= reading:
                return belief.place
        return self._out.region_at(reading)

    @property
    def way_home(self) -> WayHome:
        """The way home: the border to the next ASR, and a point ahead on the way out.

        On the way home it follows the trail of the way out (see `Trail` and `WayBack`). There is no
        border ahead if the robot believes to be in its home ASR. Without a trail no way is known,
        as in the paper, which tells nothing of how its robot is guided.
        """
        way = np.full(7, np.nan)
        if self._trail is None:
            way[TRAVEL] = np.inf
            return way
        way[TRAVEL] = self._path.travelled
        if self._way_back is None:
            return way
        way[POINT], left = self._way_back.ahead(self._pose)
        way[TRAVEL] += left
        place = self.estimate.place
        if place:
            way[EXIT] = self._way_back.border(int(self._out.regions.splits[place]))[0]
        return way

    def snapshot(self) -> MapSnapshot:
        """Return the surfaces beside all paths, and the ASRs of the way out."""
        surfaces = np.concatenate([each.steps.surfaces for each in self.geometric_maps])
        return MapSnapshot(layers=(SegmentsLayer(segments=surfaces), self._place_graph()))

    def _place_graph(self) -> PlaceGraph:
        regions = self._out.regions
        nodes = []
        for k in range(regions.count):
            inside = self._out.part(k)
            pose = np.array((*regions.lines[k, :2], regions.directions[k]))
            nodes.append(
                PlaceNode(
                    id=k,
                    label=f"A{k}",
                    pose=pose,
                    middle=inside.lines.reshape(-1, 2).mean(axis=0),
                    segments=transform_segments(inverse(pose), inside.surfaces),
                )
            )
        edges: list[PlaceEdge] = []
        for before, after in pairwise(nodes):
            for one, other, reverse in ((before, after, 1), (after, before, -1)):
                motion = relative(one.pose, other.pose)
                back = len(edges) + reverse
                edges.append(PlaceEdge(source=one.id, target=other.id, motion=motion, reverse=back))
        current = self.estimate.place if nodes else None
        return PlaceGraph(
            nodes=tuple(nodes),
            edges=tuple(edges),
            current=current,
            home=0 if nodes else None,
        )

    def _sizes(self) -> dict[str, Any]:
        return {"cues": len(self.config.localisation.cues), "region_config": self.config.regions}

    def _stored(self) -> dict[str, Any]:
        path, is_returning = self._path, self.is_returning + self._was_told
        ways = {"out": self._out.steps, "home": self._home.steps if self._home else NO_STEPS}
        return {
            "counts": (self._readings, self._updates, is_returning, self._fusion.time),
            "path.samples": path.samples,
            "path.before": [] if path.direction_before is None else [path.direction_before],
            **{f"{way}.{name}": getattr(ways[way], name) for way in ways for name in STEPS},
            "beliefs": [(b.reading, b.place, b.rival, b.is_sure) for b in self._beliefs],
            "believed": [
                (b.confidence, b.rival_confidence, -1.0 if b.kept is None else b.kept)
                for b in self._beliefs
            ],
        }

    def _restored(self, state: Arrays) -> None:
        self._readings, self._updates, is_returning, self._fusion.time = state["counts"].tolist()
        self._was_told = is_returning == 2
        self._path.samples = [tuple(row) for row in state["path.samples"].tolist()]
        self._path.direction_before = next(iter(state["path.before"].tolist()), None)
        self._out.extend(steps_of(state, "out"))
        if is_returning:
            self._home = GeometricMap(self.config.regions)
            self._home.extend(steps_of(state, "home"))
        self._way_back = self._lay_out() if len(self._out.steps.lines) else None
        rows = zip(state["beliefs"].tolist(), state["believed"].tolist(), strict=True)
        self._beliefs = [
            Belief(
                reading=reading,
                place=place,
                confidence=confidence,
                rival=rival,
                rival_confidence=rival_confidence,
                is_sure=bool(sure),
                kept=None if kept < 0.0 else kept,
            )
            for (reading, place, rival, sure), (confidence, rival_confidence, kept) in rows
        ]
