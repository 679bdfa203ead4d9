"""Albot0: a robot with eight sonars and an odometer that it does not correct.

Schmidt, Wong and Yeap. On its way out the robot makes a geometric map, which is split into absolute
space representations (ASRs). Then it turns round, maps the way home anew, and localises itself in
the ASRs of the way out: by how far it has come in ASR lengths, and by how it turned from one ASR
into the next. Both maps are inexact and neither is ever corrected or laid over the other. Beside
them the robot keeps its way as odometer and echoes together have it (`Trail`), which the way home
and the cue `way` go by: that is ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

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
from albot_core.mappers.albot0.paths import SAMPLE, PathInProgress, side_sonars
from albot_core.mappers.albot0.state import SHAPES, check_beliefs, check_path
from albot_core.mappers.albot0.steps import Steps, join_steps
from albot_core.mappers.albot0.trail import Trail
from albot_core.mappers.albot0.way_back import WayBack
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, Estimate, MapperSpec, WayHome
from albot_core.mappers.random_state import generator_of, generator_state
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.stored_arrays import Shape, check_finite, check_shapes
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, SegmentsLayer
from albot_core.sensing.reading import Reading


class Albot0:
    """Albot0's cognitive map, and its localisation on the way home.

    The number of an ASR is its place on the way out: home is 0. As the journey is split anew at
    every stop, numbers may change until the robot turns round for home. It remembers places
    (`PlaceMemory`), which are ASRs.

    Args:
        config: All thresholds.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: Albot0Config | None = None, name: str = "albot0") -> None:
        self._name = name
        self.config = config or Albot0Config()
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""
        return mapper_spec(self._name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Numbers are drawn all along."""
        self._rng = rng
        self._pose = np.zeros(3)
        self._readings = 0
        self._updates = 0
        self._path = PathInProgress(samples=[])
        self._out = GeometricMap(self.config.regions)
        self._trail = Trail(self.config.trail, rng)
        self._home: GeometricMap | None = None
        self._was_told = False
        self._way_back: WayBack | None = None
        self._fusion = DemocraticIntegration.of(len(self.config.localisation.cues))
        self._confidences: Confidences = np.empty(0)
        self._beliefs: list[Belief] = []

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where a robot path came to its end, which the map then holds.

        Raises:
            InputError: The reading lacks sonars, or none of them looks to one of the sides.
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
        """Take what was driven so far for the way out, and all that follows for the way home.

        Without this the mapper finds out by itself where the robot turns round (see
        `PathConfig.detects_return`), and the latest time counts. A robot that has gone nowhere is
        at home, and stays on its way out.
        """
        self.end_path()
        if self._out.regions.count:
            self._turn_round()
            self._was_told = True

    def end_path(self) -> None:
        """End the robot path here, where the robot stands; on the way home, localise it.

        Without this a path ends by itself where the robot turns, or when it is long enough.
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
        """Map the path that came to its end; on the way home, localise the robot."""
        self._updates += 1
        if self._home is None:
            self._out.extend(steps)
            self._trail.extend(steps)
            self._way_back = self._lay_out()
            return
        self._home.extend(steps)
        self._trail.extend(steps)
        self._way_back = self._lay_out()
        stop, config = self.last_stop, self.config.localisation
        maps = np.stack([CUES[name](stop, config) for name in config.cues])
        self._believe(self._fusion.fuse(maps))

    def _lay_out(self) -> WayBack:
        """The way home, from where the robot may be now."""
        out, trail = slice(0, len(self._out.steps.lines)), self._trail
        steps, config = trail.steps, self.config.way_back
        return WayBack(steps.part(out), steps.surfaces, trail.particles, trail.frame, config)

    def _believe(self, confidences: Confidences) -> None:
        self._confidences = confidences
        reading = max(self._readings - 1, 0)
        self._beliefs.append(Belief.of(reading, confidences, self.config.localisation))

    @property
    def last_stop(self) -> Stop:
        """What the cues go by, since the last stop on the way home.

        Raises:
            InputError: The robot is on its way out.
        """
        if self._home is None or self._way_back is None:
            raise InputError("last_stop", "a robot on its way home", "one on its way out")
        beside = self._way_back.fit(self._out.regions)
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
        """The ASR that the robot believes to be in, and where the odometer says that it is.

        On the way home it is not localised at borders, and matches the present reading with one
        from the middle of the ASR that it is sure of.
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
            home=self._trail.frame.copy(),
            localised=is_sure,
            place=place,
            matched_reading=matched,
            updates=self._updates,
            map_version=self._updates,
            segments=sum(int(each.steps.walled.sum()) for each in self.geometric_maps),
        )

    @property
    def events(self) -> Sequence[Belief]:
        """What it believed at every stop on its way home."""
        return tuple(self._beliefs)

    def place_at(self, reading: int) -> int:
        """The ASR where a reading was taken; on the way home, in which it was believed to be."""
        for belief in reversed(self._beliefs):
            if belief.reading <= reading:
                return belief.place
        return self._out.region_at(reading)

    @property
    def way_home(self) -> WayHome:
        """The way home: the border to the next ASR, and a point ahead on the way out.

        On the way home it is the trail of the way out (see `Trail` and `WayBack`). Where the robot
        believes to be in its home ASR there is no border before it.
        """
        way = np.full(7, np.nan)
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
        """The surfaces beside all paths, and the ASRs of the way out."""
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

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        path, before = self._path, self._path.direction_before
        home = self._home or GeometricMap(self.config.regions)
        is_returning = self.is_returning + self._was_told
        counts = (self._readings, self._updates, is_returning, self._fusion.time)
        beliefs = [(b.reading, b.place, b.rival, b.is_sure) for b in self._beliefs]
        believed = [(b.confidence, b.rival_confidence) for b in self._beliefs]
        return {
            "pose": self._pose.copy(),
            "counts": np.array(counts, np.int64),
            "path.samples": np.array(path.samples).reshape(-1, SAMPLE).astype(np.float64),
            "path.numbers": np.array((path.heading, path.travelled)),
            "path.before": np.array([] if before is None else [before], np.float64),
            **self._out.state("out"),
            **home.state("home"),
            **self._trail.state(),
            "rng": generator_state(self._rng),
            "weights": self._fusion.weights.copy(),
            "confidences": self._confidences.copy(),
            "beliefs": np.array(beliefs, np.int64).reshape(-1, 4),
            "believed": np.array(believed, np.float64).reshape(-1, 2),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        shapes: dict[str, Shape] = {**SHAPES, "weights": (len(self.config.localisation.cues),)}
        check_shapes(state, shapes)
        check_finite(state, *(name for name in shapes if name != "counts"))
        readings, updates, is_returning, time = state["counts"].tolist()
        if min(readings, updates, time) < 0 or is_returning not in (0, 1, 2):
            found = str(state["counts"].tolist())
            raise InputError("counts", "three counts, and 0, 1 or 2", found)
        check_path(state, readings)
        out, home = GeometricMap(self.config.regions), GeometricMap(self.config.regions)
        out.restore("out", state, readings)
        home.restore("home", state, readings)
        if not is_returning and len(home.steps.lines):
            raise InputError("home.lines", "none before the robot turned round", "some")
        if is_returning and not out.regions.count:
            raise InputError("out.lines", "a way out before the way home", "none")
        check_beliefs(state, out.regions.count if is_returning else 0, readings)
        self._pose = state["pose"].copy()
        self._readings, self._updates = readings, updates
        heading, travelled = state["path.numbers"].tolist()
        before = state["path.before"].tolist()
        self._path = PathInProgress(
            samples=[tuple(row) for row in state["path.samples"].tolist()],
            heading=heading,
            travelled=travelled,
            direction_before=before[0] if before else None,
        )
        self._out, self._home = out, home if is_returning else None
        self._was_told = is_returning == 2
        self._rng = generator_of(state["rng"])
        self._trail = Trail(self.config.trail, self._rng)
        self._trail.restore(state, join_steps(out.steps, home.steps))
        self._way_back = self._lay_out() if len(out.steps.lines) else None
        self._fusion = DemocraticIntegration(weights=state["weights"].copy(), time=time)
        self._confidences = state["confidences"].copy()
        rows = zip(state["beliefs"].tolist(), state["believed"].tolist(), strict=True)
        self._beliefs = [
            Belief(
                reading=reading,
                place=place,
                confidence=confidence,
                rival=rival,
                rival_confidence=rival_confidence,
                is_sure=bool(sure),
            )
            for (reading, place, rival, sure), (confidence, rival_confidence) in rows
        ]
