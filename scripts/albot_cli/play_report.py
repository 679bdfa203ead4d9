"""What `albot play` tells of an episode, for people and programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from albot_cli.evaluation_text import recall_text
from albot_cli.outputs import FigureFile
from albot_core.counts import many
from albot_env.rendering.frame import lengths_text

if TYPE_CHECKING:
    from albot_cli.episodes import PlayedEpisode


def episode_summary(episode: PlayedEpisode) -> dict[str, Any]:
    """Return the summary of an episode, from its last frame."""
    frame = episode.frame
    return {
        "task": frame.environment,
        "world": frame.world,
        "agent": frame.agent,
        "mapper": frame.mapper,
        "steps": episode.step,
        "path_m": frame.path_length,
        "driven_m": frame.driven,
        "way_out_m": frame.way_out_length,
        "updates": frame.updates,
        "surfaces": len(frame.snapshot.segments),
        "position_error_m": frame.position_error,
        "localised": frame.localised,
        "simulated_s": frame.time,
        "reward": sum(frame.terms.values()),
        "steps_in_contact": episode.contacts,
    }


def file_names(
    episode: Path, png: Path | None, figure: FigureFile | None, video: Path | None
) -> dict[str, str | None]:
    """Return the paths by kind of file, those of figure and video only if they were asked for."""
    files = {"episode": str(episode), "picture": None if png is None else str(png)}
    files |= {} if figure is None else {"figure": str(figure.path)}
    return files if video is None else {**files, "video": str(video)}


def episode_text(summary: dict[str, Any]) -> str:
    """Return the summary as text."""
    rooms, covered, success = (summary[key] for key in ("rooms_entered", "coverage", "success"))
    figures = [
        lengths_text(summary["driven_m"], summary["way_out_m"]),
        many(summary["updates"], "update"),
        *([many(summary["surfaces"], "surface")] if summary["surfaces"] else []),
        f"{summary['position_error_m']:.2f} m off",
        *(["lost in the saved map"] if summary["localised"] is False else []),
        *([] if rooms is None else [f"{many(rooms, 'room')} entered"]),
        *([] if covered is None else [f"{covered:.0%} of the ground covered"]),
        f"reward {summary['reward']:.2f}",
        *([] if summary["revisits"] is None else [recall_text(summary)]),
        *([] if success is None else ["a success" if success else "no success"]),
    ]
    lines = [
        f"{summary['agent']} at {summary['task']} in {summary['world']} with {summary['mapper']}, "
        f"seed {summary['seed']}, {many(summary['steps'], 'step')}, "
        f"{summary['simulated_s']:.0f} s:",
        f"  {' · '.join(figures)}",
        f"  episode  {summary['files']['episode']}  (albot play FILE, or Lichtblick, or Foxglove)",
    ]
    drawn = {kind: summary["files"].get(kind) for kind in ("picture", "figure", "page", "video")}
    lines += [f"  {kind:<7}  {path}" for kind, path in drawn.items() if path]
    return "\n".join(lines)
