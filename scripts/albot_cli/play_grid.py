"""Several episodes of a task at once, as one mosaic: `albot play --grid`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium

from albot_agents.agent import EnvironmentConfigs
from albot_agents.registry import AgentEntry
from albot_cli.episodes import RunningEpisode
from albot_cli.film import Painter, film
from albot_cli.grid_type import Grid
from albot_cli.watch import open_viewer
from albot_core.files import atomic_write
from albot_env.rendering.canvas import png_bytes
from albot_env.rendering.mosaic import Tile, paint_mosaic
from albot_env.rendering.video import open_video
from albot_env.tasks.core.single import SingleEnv
from albot_maps.generators.spec import seeded

OUTCOMES = {True: "success", False: "no success", None: "the end"}
"""How an episode ended, by the success that its info tells."""


class EpisodeGrid:
    """Episodes that run side by side; those that are over wait for the others.

    Args:
        episodes: The episodes.
        seeds: Their seeds.
        columns: Number of tiles in a row.
    """

    def __init__(
        self, episodes: Sequence[RunningEpisode], seeds: Sequence[int], columns: int
    ) -> None:
        self.episodes = episodes
        self.time = 0.0
        """Simulated time since the beginning (s); a step lasts as long as the longest of them."""
        self._seeds, self._columns = seeds, columns

    @property
    def over(self) -> bool:
        """Whether all are over."""
        return all(episode.over for episode in self.episodes)

    def advance(self) -> None:
        """Take a step in each that is not over."""
        running = [episode for episode in self.episodes if not episode.over]
        before = [episode.time for episode in running]
        for episode in running:
            episode.advance()
        took = [episode.time - its for episode, its in zip(running, before, strict=True)]
        self.time += max(took, default=0.0)

    def capture(self) -> Painter:
        """Return what paints the present moments."""
        tiles = [self._tile(k) for k in range(len(self.episodes))]
        return partial(paint_mosaic, tiles, self._columns)

    def _tile(self, k: int) -> Tile:
        episode, label = self.episodes[k], f"seed {self._seeds[k]}"
        if not episode.over:
            return Tile(frame=episode.frame, label=label)
        success = episode.info.get("is_success")
        success = None if success is None else bool(success)
        outcome = OUTCOMES[success]
        return Tile(frame=episode.frame, label=label, outcome=outcome, is_success=success)


def play_grid(
    task: str,
    agent: str,
    entry: AgentEntry,
    settings: dict[str, Any],
    grid: Grid,
    *,
    seed: int,
    steps: int,
    png: Path | None,
    video: Path | None,
    speed: float,
) -> dict[str, Any]:
    """Run episodes side by side, write their mosaic, and return their summary.

    Args:
        task: Id of the environment.
        agent: The agent's name.
        entry: The agent.
        settings: Arguments of `gymnasium.make`. Of a world `random:KIND`, each seed is one.
        grid: The tiles of the mosaic.
        seed: Seed of the first episode, counted up for the others.
        steps: Largest number of steps of an episode.
        png: Where the picture of the last moments is written, if anywhere.
        video: Where the video is written, if anywhere.
        speed: How many times faster than real time it is filmed.
    """
    seeds = range(seed, seed + grid.columns * grid.rows)
    with ExitStack() as opened:
        episodes = []
        for its in seeds:
            world = seeded(settings["world"], its)
            env = gymnasium.make(
                task,
                render_mode="rgb_array",
                max_episode_steps=steps,
                disable_env_checker=True,
                **{**settings, "world": world},
            )
            opened.enter_context(closing(env))
            inside = env.unwrapped
            assert isinstance(inside, SingleEnv)
            inside.agent = agent
            driver = entry.make(EnvironmentConfigs.of(env))
            episodes.append(RunningEpisode(env, driver, its, steps=steps))
        side_by_side = EpisodeGrid(episodes, seeds, grid.columns)
        title = f"{agent} in {settings['world']}"
        longest = max(episode.steps for episode in episodes)
        with open_viewer(title, longest, headless=True) as (_, update):
            _run(side_by_side, video, speed, update)
        if png is not None:
            with atomic_write(png) as stream:
                stream.write(png_bytes(side_by_side.capture()()))
    return {
        "task": task,
        "world": settings["world"],
        "agent": agent,
        "mapper": episodes[0].frame.mapper,
        "seed": seed,
        "episodes": [_row(its, each) for its, each in zip(seeds, episodes, strict=True)],
        "files": {
            "picture": None if png is None else str(png),
            "video": None if video is None else str(video),
        },
    }


def _run(grid: EpisodeGrid, video: Path | None, speed: float, update: Callable[[], None]) -> None:
    if video is not None:
        with open_video(video) as writer:
            film(grid, writer, grid.capture, speed=speed, update=update)
    while not grid.over:
        grid.advance()
        update()


def _row(seed: int, episode: RunningEpisode) -> dict[str, Any]:
    frame, info = episode.frame, episode.info
    return {
        "seed": seed,
        "world": frame.world,
        "steps": episode.step,
        "simulated_s": frame.time,
        "path_m": frame.path_length,
        "position_error_m": frame.position_error,
        "coverage": info.get("coverage"),
        "reward": sum(frame.terms.values()),
        "success": info.get("is_success"),
    }


def grid_text(summary: dict[str, Any]) -> str:
    """Return the summary of `play_grid` as text, a line for each episode."""
    lines = [
        f"{summary['agent']} at {summary['task']} in {summary['world']} with {summary['mapper']}:"
    ]
    for row in summary["episodes"]:
        figures = [
            f"{row['steps']} steps",
            f"{row['path_m']:.1f} m",
            f"{row['position_error_m']:.2f} m off",
            f"reward {row['reward']:.2f}",
        ]
        if row["coverage"] is not None:
            figures.append(f"{row['coverage']:.0%} of the ground covered")
        if row["success"] is not None:
            figures.append(OUTCOMES[row["success"]])
        lines.append(f"  seed {row['seed']:<6} {' · '.join(figures)}")
    lines += [f"  {kind:<7}  {path}" for kind, path in summary["files"].items() if path]
    return "\n".join(lines)
