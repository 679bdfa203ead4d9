"""The scene of a Rerun recording: robots, points, lines, graphs and curves, in the plane z = 0."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.files import atomic_write, scratch_folder
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.maps.layers import PlaceGraph

Colour = tuple[int, int, int]
"""Red, green and blue, from 0 to 255."""
RERUN_EXTRA = "pip install 'albot-env[rerun]'"
"""The command that installs Rerun."""
DOT = 0.03
"""Usual radius of a point (m)."""
_THIN = 0.015
"""Radius of lines (m)."""
_APPLICATION = "albot-env"


def check_rerun(source: object) -> None:
    """Check that Rerun is installed.

    Args:
        source: The file to write, for the error.

    Raises:
        InputError: It is missing; the message says how to install it.
    """
    if find_spec("rerun") is None:
        expected = f"what the extra `rerun` brings ({RERUN_EXTRA})"
        raise InputError(source, expected, "the package rerun-sdk missing")


@contextmanager
def rerun_recording(path: Path, name: str) -> Iterator[RerunScene]:
    """Yield the scene of a recording that is written to `path`, atomically, when the block ends.

    Args:
        path: The file.
        name: Id of the recording.

    Raises:
        InputError: Rerun is not installed, or the file cannot be written.
    """
    check_rerun(path)
    import rerun
    from rerun import blueprint

    with scratch_folder() as scratch:
        made = scratch / "recording.rrd"
        # The id is the same each time, and no clock is read.
        stream = rerun.RecordingStream(_APPLICATION, recording_id=name, send_properties=False)
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        views = blueprint.Horizontal(
            blueprint.Spatial3DView(origin="world"),
            blueprint.Vertical(
                blueprint.TimeSeriesView(origin="curves"),
                blueprint.GraphView(origin="place_graph"),
            ),
            column_shares=[2, 1],
        )
        stream.save(made, default_blueprint=blueprint.Blueprint(views))
        try:
            yield RerunScene(stream)
        finally:
            stream.disconnect()
        with made.open("rb") as written, atomic_write(path) as target:
            shutil.copyfileobj(written, target)


class RerunScene:
    """A Rerun recording that is being written: what is shown, at the time that was set last.

    Args:
        stream: The stream of the recording.
    """

    def __init__(self, stream: Any) -> None:
        import rerun

        self._stream, self._rerun = stream, rerun
        stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def at(self, step: int, seconds: float) -> None:
        """Set the time of what is shown next."""
        self._stream.set_time("step", sequence=step)
        self._stream.set_time("time", duration=seconds)

    def frame(self, entity: str, pose: Pose, *, static: bool = False) -> None:
        """Place a frame in the one above it."""
        self._stream.log(entity, self._transform(pose), static=static)

    def robot(self, entity: str, pose: Pose, colour: Colour) -> None:
        """Show a robot as an arrow in its frame."""
        arrow = self._rerun.Arrows3D(vectors=[(0.4, 0.0, 0.0)], colors=colour)
        self._stream.log(entity, self._transform(pose), arrow)

    def points(
        self,
        entity: str,
        points: Points,
        colour: Colour,
        *,
        radius: float = DOT,
        labels: list[str] | None = None,
    ) -> None:
        """Show points."""
        shown = self._rerun.Points3D(_in_space(points), radii=radius, colors=colour, labels=labels)
        self._stream.log(entity, shown)

    def lines(
        self,
        entity: str,
        segments: Segments,
        colour: Colour,
        *,
        static: bool = False,
    ) -> None:
        """Show line segments."""
        strips = _in_space(segments.reshape(-1, 2)).reshape(-1, 2, 3)
        shown = self._rerun.LineStrips3D(strips, radii=_THIN, colors=colour)
        self._stream.log(entity, shown, static=static)

    def strip(self, entity: str, points: Points, colour: Colour, *, static: bool = False) -> None:
        """Show a line through points."""
        strips = [_in_space(points)] if len(points) > 1 else []
        shown = self._rerun.LineStrips3D(strips, radii=_THIN, colors=colour)
        self._stream.log(entity, shown, static=static)

    def graph(self, entity: str, graph: PlaceGraph) -> None:
        """Show places and their links as a graph."""
        names = {node.id: str(node.id) for node in graph.nodes}
        labels = [node.label for node in graph.nodes]
        nodes = self._rerun.GraphNodes(list(names.values()), labels=labels)
        edges = [(names[a], names[b]) for a, b in graph.links]
        self._stream.log(entity, nodes, self._rerun.GraphEdges(edges))

    def curves(self, rows: Mapping[str, Sequence[tuple[int, float, float]]]) -> None:
        """Show numbers by name, as rows of step, time (s) and number."""
        for name, row in rows.items():
            steps, seconds, numbers = zip(*row, strict=True)
            indexes = [
                self._rerun.TimeColumn("step", sequence=steps),
                self._rerun.TimeColumn("time", duration=seconds),
            ]
            columns = self._rerun.Scalars.columns(scalars=numbers)
            self._stream.send_columns(f"curves/{name}", indexes=indexes, columns=columns)

    def _transform(self, pose: Pose) -> Any:
        x, y, heading = pose.tolist()
        turn = self._rerun.Quaternion(xyzw=(0, 0, np.sin(heading / 2), np.cos(heading / 2)))
        return self._rerun.Transform3D(translation=(x, y, 0.0), quaternion=turn)


def _in_space(points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 3"]:
    return np.column_stack((points, np.zeros(len(points))))
