"""A picture of `map_patch` beside the map, with several mappers on the same drive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import gymnasium
import numpy as np

from albot_agents.agent import EnvironmentConfigs
from albot_agents.registry import make_agent
from albot_cli.path_type import PathType
from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import DARK, DARK_FREE, rgb
from albot_core.errors import InputError
from albot_core.geometry.poses import transform_segments
from albot_core.mappers.registry import installed_mappers
from albot_core.maps.layers import OccupancyGridLayer, TrajectoryLayer
from albot_env.tasks.core.observation import DEFAULT_PARTS
from albot_env.tasks.core.parts.map_patch import MAP_PATCH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAPPERS = ("albot1", "association", "gmapping", "graph-slam", "ratslam")
WORLD, SEED, STEPS = "random:office:3", 1, 1500
COLOURS = {
    name: tuple(share / 255 for share in rgb(colour))
    for name, colour in (
        ("free", DARK_FREE),
        ("walls", DARK["surface"]),
        ("trail", DARK["believed"]),
        ("exits", DARK["doorway"]),
        ("places", DARK["place"]),
        ("home", DARK["home"]),
    )
}
"""The channels in the order in which they are painted, and their colours."""
_GROUND = 0.06
ROBOT = (1.0, 0.2, 0.2)


@click.command()
@click.argument("out", type=PathType())
@click.option("--mapper", "mappers", multiple=True, default=MAPPERS, show_default=True)
def command(out: Path, mappers: Sequence[str]) -> None:
    """Draw the map and its patches with each mapper after the same drive, into the PNG file OUT."""
    from matplotlib.figure import Figure  # slow to load

    for mapper in mappers:
        if mapper not in installed_mappers():
            raise InputError("--mapper", f"one of {', '.join(installed_mappers())}", mapper)
    figure = Figure(figsize=(9.0, 3.1 * len(mappers)), layout="constrained")
    rows = np.reshape(figure.subplots(len(mappers), 3), (-1, 3))
    for axes, mapper in zip(rows, mappers, strict=True):
        _draw(axes, mapper)
    save_figure(figure, out)
    click.echo(str(out))


def _draw(axes: Sequence[Axes], mapper: str) -> None:
    """Drive with a mapper, and draw its map and both patches."""
    seen = {"parts": [*DEFAULT_PARTS, "map_patch"]}
    env = gymnasium.make(
        "Albot/Explore-v0", world=WORLD, mapper=mapper, config={"observations": seen}
    )
    configs = EnvironmentConfigs.of(env)
    agent = make_agent("gap-explorer", configs)
    agent.reset(np.random.default_rng((SEED, 1)), env.action_space)
    observation, _ = env.reset(seed=SEED)
    for _ in range(STEPS):
        observation, *_ = env.step(agent.act(observation, {}))
    task: Any = env.unwrapped._robot  # type: ignore[attr-defined]
    patch = configs.observations.decode(MAP_PATCH, observation)
    _draw_map(axes[0], task.snapshot(0), task.beliefs[0], patch.sides)
    axes[0].set_title(f"{mapper}: its map")
    for square, (axis, side) in enumerate(zip(axes[1:], patch.sides, strict=True)):
        axis.imshow(painted(patch.channels, square), interpolation="nearest")
        axis.set_title(f"patch of {side:g} m: {', '.join(patch.channels)}", fontsize=7)
        axis.set_axis_off()
    env.close()


def painted(channels: dict[str, np.ndarray], square: int) -> np.ndarray:
    """Return one square of a patch as an image, (cells, cells, 3) from 0 to 1."""
    image = np.full((*next(iter(channels.values())).shape[1:], 3), _GROUND)
    for name, colour in COLOURS.items():
        if name in channels:
            shown = channels[name][square]
            image[shown > -1] = np.array(colour)
            if name == "trail":
                share = np.clip(shown, 0.25, 1.0)[..., None]
                image = np.where(shown[..., None] > -1, share * np.array(colour), image)
    middle = len(image) // 2
    image[middle - 1 : middle + 1, middle - 1 : middle + 1] = ROBOT
    return np.asarray(image)


def _draw_map(axis: Axes, snapshot: Any, pose: np.ndarray, sides: Sequence[float]) -> None:
    """Draw a map in its own frame, with the robot and the frames of the patches."""
    axis.set_facecolor((_GROUND,) * 3)
    grid, way = snapshot.layer(OccupancyGridLayer), snapshot.layer(TrajectoryLayer)
    if grid is not None:
        axis.plot(*grid.centres(0.5).T, ",", color=COLOURS["walls"])
    for x1, y1, x2, y2 in snapshot.segments:
        axis.plot((x1, x2), (y1, y2), color=COLOURS["walls"], linewidth=0.8)
    if way is not None and len(way.poses):
        axis.plot(*way.poses[:, :2].T, color=COLOURS["trail"], linewidth=0.6)
    graph = snapshot.place_graph
    if graph.nodes and len(graph.nodes) < 200:
        axis.plot(
            *np.array([node.middle for node in graph.nodes]).T, "o", ms=2, color=COLOURS["places"]
        )
    axis.plot(*pose[:2], "o", ms=4, color=ROBOT)
    half = sides[0] / 2
    corners = np.array(((half, half), (-half, half), (-half, -half), (half, -half)))
    lines = np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)
    for x1, y1, x2, y2 in transform_segments(pose, lines):
        axis.plot((x1, x2), (y1, y2), color="grey", linewidth=0.6)
    axis.set_aspect("equal")
    axis.tick_params(labelsize=6)
