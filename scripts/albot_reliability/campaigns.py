"""The section on campaigns: episodes in random worlds whose every step was checked."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from albot_core.yaml_document import dump_yaml, read_yaml
from albot_reliability.fault_sampling import ROOT
from albot_stress.campaign import read_campaign

CAMPAIGNS = ("all_worlds", "explorers", "faults", "homing", "mission")
"""The campaigns that are run, files of `docs/campaigns`."""
_FOLDER = Path("docs/campaigns")
_INTRODUCTION = """\
Episodes in random worlds, each step of which was checked: no number is NaN or outside its space;
the reward is the sum of its terms; the robot is in no wall, box or person, and none of these is
behind a wall; ranges are those of the surfaces around, by another ray caster, an eighth of the
beams and sonars at each step in turns; maps are finite and bounded, and their places connected; a
second mapper with the same readings believes the same to the bit; of one episode in five hundred,
the recording replays to the bit ([campaigns](campaigns.md)). The machine was shared with other
work, so that the steps a second are no measure of speed ([scaling](scaling.md) is)."""


def measure(share: float, jobs: int, before: Mapping[str, Any]) -> dict[str, Any]:
    """Run the campaigns; return their results by name.

    Args:
        share: Share of each campaign's worlds.
        jobs: Number of processes.
        before: The figures before.
    """
    return {name: _run(name, share, jobs) for name in CAMPAIGNS}


def _run(name: str, share: float, jobs: int) -> dict[str, Any]:
    """Run a campaign, or a share of its worlds."""
    whole = ROOT / _FOLDER / f"{name}.yml"
    count = max(1, round(share * read_campaign(whole).count))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / whole.name
        path.write_text(dump_yaml({**read_yaml(whole).data, "count": count}), encoding="utf-8")
        words = ["-m", "albot_cli.main", "stress", str(path), "--jobs", str(jobs), "--json"]
        done = subprocess.run(
            [sys.executable, *words], cwd=folder, stdout=subprocess.PIPE, text=True, check=False
        )
    found: dict[str, Any] = json.loads(done.stdout)
    kept = ("worlds", "agents", "episodes", "steps", "seconds", "steps_per_second")
    violations = len(found["violations"])
    return {key: found[key] for key in kept} | {"jobs": jobs, "violations": violations}


def render(figures: Mapping[str, Any]) -> Iterable[str]:
    """Yield the section's lines."""
    yield "## Campaigns"
    yield ""
    yield _INTRODUCTION
    yield ""
    yield "| command | worlds | agents | episodes | checked steps | steps/s | violations |"
    yield "|---|---|---|---|---|---|---|"
    for name, found in figures.items():
        cells = (
            f"`albot stress {_FOLDER}/{name}.yml --jobs {found['jobs']}`",
            f"{found['worlds']:,}",
            ", ".join(found["agents"]),
            f"{found['episodes']:,}",
            f"{found['steps']:,}",
            f"{found['steps_per_second']:,.0f}",
            f"{found['violations']:,}",
        )
        yield f"| {' | '.join(cells)} |"
