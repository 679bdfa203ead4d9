"""Comparison of all mappers, on real logs and in random worlds: writes docs/comparison.md.

It measures as `albot compare` does. Each source has a folder in docs/comparison, with its figures
and a picture of each mapper's map. Results that are not measured again are kept.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from PIL import Image

from albot_agents.engine.local import LocalEngine
from albot_cli.compare import explored_sources, recorded_sources
from albot_cli.comparison_report import FIGURES, as_markdown, panels_of, rows_of
from albot_cli.mapper_runs import MapperChoice, Source, compare_mappers
from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.export.picture import maps_figure
from albot_core.files import atomic_write, write_text
from albot_core.mappers.registry import installed_mappers, mapper_spec

MAPPERS = (
    "odometry",
    "albot1",
    "albot1-thesis",
    "albot1-tracked",
    "association",
    "association-paper",
    "ratslam",
    "scan-matching",
    "graph-slam",
    "gmapping",
    "grid-slam",
    "dp-slam",
    "fastslam",
    "hssh",
    "sahabot",
    "sahabot-wheels",
    "karto",
)
"""The mappers that use a laser. `sahabot` also needs a compass, which the logs lack."""
STEPS = 3000
"""Length of the exploration of a world (steps of 0.1 s)."""
_AGENT, _ODOMETER, _COMPASS = "gap-explorer", "poor", "polarised"
_WIDTH, _COLOURS = 420, 160
"""Width of a map's picture (pixels), and number of its colours."""
_ACROSS = 4
"""Number of pictures side by side."""


@dataclass(frozen=True, kw_only=True)
class RealLog:
    """A log for the comparison; file names are relative to the data folder's folder of logs."""

    title: str
    """Title above its table."""
    file: str
    """The log."""
    reference: str | None = None
    """File of the robot's true poses."""
    relations: str | None = None
    """File of true relations between its poses."""

    def read(self, logs: Path) -> list[Source]:
        """Read the log."""
        truth = None if self.reference is None else logs / self.reference
        relations = None if self.relations is None else logs / self.relations
        return recorded_sources(str(logs / self.file), range(1), truth, relations, False)


@dataclass(frozen=True, kw_only=True)
class RandomOffice:
    """A random world that is explored once; all mappers use the same readings."""

    seed: int
    """Seed of the world, of the episode and of the mappers."""

    @property
    def title(self) -> str:
        """Title above its table."""
        return f"Random office {self.seed}, explored for {STEPS // 10} s, odometer `{_ODOMETER}`"

    def read(self, logs: Path) -> list[Source]:
        """Explore the world, and return the readings."""
        sensors = {"odometer": _ODOMETER, "compass": _COMPASS}
        seeds = range(self.seed, self.seed + 1)
        return explored_sources("random:office", seeds, _AGENT, STEPS, sensors, LocalEngine(1))


SOURCES: Mapping[str, RealLog | RandomOffice] = {
    "intel": RealLog(
        title="Intel Research Lab, raw odometry",
        file="intel_raw.json.gz",
        reference="intel_reference.json.gz",
        relations="intel.relations",
    ),
    "aces": RealLog(title="ACES, Austin", file="aces-corrected.log.gz"),
    "freiburg-101": RealLog(title="Freiburg, building 101", file="freiburg-101-corrected.log.gz"),
    "wean-1": RealLog(title="Wean Hall 1", file="wean_robotdata1.log.xz"),
    "wean-2": RealLog(title="Wean Hall 2", file="wean_robotdata2.log.xz"),
    "duke": RealLog(title="Duke, loop 5", file="duke_loop5.log.xz"),
    "office-9001": RandomOffice(seed=9001),
    "office-9002": RandomOffice(seed=9002),
    "office-9003": RandomOffice(seed=9003),
}
"""The sources by their folders' names, in the order of the page."""
_HEAD = """\
# Mappers side by side

All mappers that see by a laser, each with its default parameters, on the same readings, measured as
by `albot compare` ([what each figure is](logs.md#several-mappers-side-by-side)). This page is
written by one command, of which `--source` and `--mapper` measure a part anew:

```
ALBOT_DATA=FOLDER albot experiment study comparison
```

Errors are of the positions believed online, reading by reading, after rigid alignment; *corrected*
ones of the positions that a mapper believes at the end, of those that correct earlier ones. Mappers
that draw random numbers ran once, with one seed. Speeds are of one machine that was shared with
other work: compare them with each other only. `sahabot` needs a compass, which only the simulated
robot in the random offices has; its map, and that of `sahabot-wheels`, is one place. What was tuned
on which logs stands on the mappers' own pages. The systems of metric SLAM were tuned on Intel
alone, and looked at on Wean 1 and 2
([slam.md](slam.md)).
"""


@click.command()
@click.option(
    "--source",
    "sources",
    multiple=True,
    type=click.Choice(tuple(SOURCES)),
    help="Sources to measure again; repeatable.  [default: all]",
)
@click.option(
    "--mapper",
    "mappers",
    multiple=True,
    type=click.Choice(MAPPERS),
    help="Mappers to measure again; repeatable.  [default: all]",
)
@click.option(
    "--jobs", default=1, show_default=True, type=CountType(1), help="Number of processes."
)
@click.option("--page-only", is_flag=True, help="Measure nothing; only write the page again.")
@click.option(
    "--out",
    default=Path("docs/comparison.md"),
    show_default=True,
    type=PathType(dir_okay=False),
    help="The page; figures and pictures go into a folder beside it.",
)
def command(
    sources: tuple[str, ...], mappers: tuple[str, ...], jobs: int, page_only: bool, out: Path
) -> None:
    """Compare the mappers on real logs and in random worlds, and write the page."""
    folder = out.with_suffix("")
    if not page_only:
        data = os.environ.get("ALBOT_DATA")
        if not data:
            raise InputError("ALBOT_DATA", "the folder of real logs", "nothing")
        asked = [name for name in MAPPERS if name in (mappers or installed_mappers())]
        for name in sources or SOURCES:
            _measure(folder / name, SOURCES[name].read(Path(data) / "logs"), asked, jobs)
    write_text(out, _page(folder))
    click.echo(f"{out}, figures and pictures in {folder}")


def _measure(folder: Path, sources: list[Source], mappers: Sequence[str], jobs: int) -> None:
    """Run mappers on a source; replace their rows and pictures.

    Mappers that need a sensor that the source lacks are left out.
    """
    sensors = sources[0].log.sensors
    choices = [
        MapperChoice(label=name, name=name)
        for name in mappers
        if mapper_spec(name).sensors <= sensors
    ]
    if not choices:
        return
    with closing(compare_mappers(choices, sources, LocalEngine(jobs))) as runs:
        results = list(runs)
    folder.mkdir(parents=True, exist_ok=True)
    rows = {row["mapper"]: row for row in _rows(folder)}
    for row in rows_of(choices, results):
        rows[row["mapper"]] = row
        if panels := panels_of([row], results, sources[0]):
            picture = _picture(folder, row["mapper"])
            save_figure(maps_figure(panels), picture)
            _shrink(picture)
    log = sources[0].log
    figures: dict[str, Any] = {"readings": len(log.readings), "path_m": log.path_length}
    figures["rows"] = [rows[name] for name in MAPPERS if name in rows]
    write_text(folder / FIGURES, json.dumps(figures, indent=1) + "\n")


def _rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows measured so far."""
    path = folder / FIGURES
    rows: list[dict[str, Any]] = json.loads(path.read_text())["rows"] if path.is_file() else []
    return rows


def _picture(folder: Path, mapper: str) -> Path:
    return folder / f"{mapper}.png"


def _shrink(path: Path) -> None:
    """Scale a picture down to the size at which it is shown."""
    with Image.open(path) as drawn:
        size = _WIDTH, round(drawn.height * _WIDTH / drawn.width)
        small = drawn.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(_COLOURS)
    with atomic_write(path) as stream:
        small.save(stream, format="png", optimize=True)


def _page(folder: Path) -> str:
    """Return the page, with all figures measured so far."""
    parts = [_HEAD]
    for name, source in SOURCES.items():
        rows = _rows(folder / name)
        if not rows:
            continue
        figures = json.loads((folder / name / FIGURES).read_text())
        readings = f"{figures['readings']:,} readings along {figures['path_m']:.0f} m."
        drawn = [row["mapper"] for row in rows if _picture(folder / name, row["mapper"]).is_file()]
        pictures = _side_by_side(
            [f"![{mapper}]({folder.name}/{name}/{mapper}.png)" for mapper in drawn]
        )
        parts.append(f"\n## {source.title}\n\n{readings}\n\n{as_markdown(rows)}\n\n{pictures}\n")
    return "".join(parts)


def _side_by_side(pictures: Sequence[str]) -> str:
    """Return a table of pictures."""
    lines = ["| " * _ACROSS + "|", "| --- " * _ACROSS + "|"]
    for first in range(0, len(pictures), _ACROSS):
        cells = [*pictures[first : first + _ACROSS], *[""] * _ACROSS][:_ACROSS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
