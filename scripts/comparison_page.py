"""Writes docs/comparison.md: all mappers side by side on real logs and in random worlds.

    ALBOT_DATA=FOLDER python scripts/comparison_page.py [--source NAME]... [--jobs N]

Each source is one call of `albot compare`, which leaves its figures and a picture in a folder of
docs/comparison. What is not measured anew stays.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import click

from albot_cli.comparison_report import FIGURES, PICTURE, as_markdown
from albot_cli.main import exit_status
from albot_core.errors import InputError
from albot_core.files import write_text

MAPPERS = (
    "odometry",
    "albot1",
    "albot1-thesis",
    "association",
    "ratslam",
    "scan-matching",
    "graph-slam",
    "gmapping",
    "grid-slam",
    "dp-slam",
    "karto",
)
"""The mappers that see by a laser."""
STEPS = 3000
"""How long worlds are explored (steps of 0.1 s)."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """What mappers are compared on."""

    title: str
    """What stands above its table."""
    words: tuple[str, ...]
    """What `albot compare` is called with besides; names of files are those in the data's folder
    of logs."""


def _log(title: str, *words: str) -> Source:
    return Source(title=title, words=words)


def _world(seed: int) -> Source:
    title = f"Random office {seed}, explored for {STEPS // 10} s with the odometer `poor`"
    words = (f"random:office:{seed}", "--steps", str(STEPS), "--odometer", "poor")
    return Source(title=title, words=(*words, "--seeds", str(seed)))


SOURCES: Mapping[str, Source] = {
    "intel": _log(
        "Intel Research Lab, raw odometry",
        "intel_raw.json.gz",
        "--reference",
        "intel_reference.json.gz",
        "--relations",
        "intel.relations",
    ),
    "aces": _log("ACES, Austin", "aces-corrected.log.gz"),
    "freiburg-101": _log("Freiburg, building 101", "freiburg-101-corrected.log.gz"),
    "wean-1": _log("Wean Hall 1", "wean_robotdata1.log.xz"),
    "wean-2": _log("Wean Hall 2", "wean_robotdata2.log.xz"),
    "duke": _log("Duke, loop 5", "duke_loop5.log.xz"),
    "office-9001": _world(9001),
    "office-9002": _world(9002),
    "office-9003": _world(9003),
}
"""The sources by the names of their folders, in the order of the page."""
_HEAD = """\
# Mappers side by side

All mappers that see by a laser, each with its default thresholds, on the same readings, by
`albot compare` ([what each figure is](logs.md#several-mappers-side-by-side)). This page is written
by one command:

```
ALBOT_DATA=FOLDER python scripts/comparison_page.py
```

Errors are of the positions believed online, reading by reading, after rigid alignment; *corrected*
ones of the positions that a mapper believes at the end, of those that correct earlier ones. Mappers
that draw random numbers ran once, with one seed. Speeds are of one machine, several runs at a time:
compare them with each other only. What was tuned on which logs stands on the mappers' own pages.
The systems of metric SLAM were tuned on Intel alone, and looked at on Wean 1 and 2
([slam.md](slam.md)).
"""


@click.command()
@click.option(
    "--source",
    "names",
    multiple=True,
    type=click.Choice(tuple(SOURCES)),
    help="What is measured anew; repeatable.  [default: all]",
)
@click.option("--jobs", type=click.IntRange(1), help="Processes.  [default: one a core]")
def command(names: tuple[str, ...], jobs: int | None) -> None:
    """Compare the mappers, and write docs/comparison.md."""
    data = os.environ.get("ALBOT_DATA")
    if not data:
        raise InputError("ALBOT_DATA", "the folder of real logs", "nothing")
    folder = Path(__file__).parents[1] / "docs" / "comparison"
    folder.mkdir(exist_ok=True)
    for name in names or SOURCES:
        _compare(folder / name, SOURCES[name], Path(data) / "logs", jobs or os.cpu_count() or 1)
    write_text(folder.with_suffix(".md"), _page(folder))


def _compare(folder: Path, source: Source, logs: Path, jobs: int) -> None:
    words = [str(logs / word) if (logs / word).is_file() else word for word in source.words]
    words += ["--mappers", ",".join(MAPPERS), "--out", str(folder), "--force", "--jobs", str(jobs)]
    call = [sys.executable, "-m", "albot_cli.main", "compare", *words, "--json"]
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
    figures = json.loads((folder / FIGURES).read_text())
    # Names of files say where they lie on this machine.
    figures |= {"source": source.words[0], "files": {}}
    write_text(folder / FIGURES, json.dumps(figures, indent=1))
    (folder / "comparison.md").unlink()


def _page(folder: Path) -> str:
    """The page, of all figures that are there."""
    parts = [_HEAD]
    for name, source in SOURCES.items():
        path = folder / name / FIGURES
        if not path.is_file():
            continue
        told = json.loads(path.read_text())
        readings = f"{told['readings']:,} readings along {told['path_m']:.0f} m."
        picture = f"![The maps side by side](comparison/{name}/{PICTURE})"
        table = as_markdown(told["rows"])
        parts.append(f"\n## {source.title}\n\n{readings}\n\n{table}\n\n{picture}\n")
    return "".join(parts)


if __name__ == "__main__":
    exit_status(command)
