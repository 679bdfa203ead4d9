"""The developers' programs: both are there, and digests change with a value, its kind or shape."""

from __future__ import annotations

import json
import os
from itertools import chain, repeat
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from click.testing import CliRunner

from albot_reliability.__main__ import PROGRAMS, main
from albot_reliability.digests import Digests
from albot_reliability.fault_sampling import ROOT, all_faults, draw_faults, modules
from albot_stress.campaign import read_campaign

with patch.dict(os.environ):  # It limits the threads of all that is loaded after it.
    from albot_reliability import campaigns, fuzzing
    from albot_reliability.page import SECTIONS


@pytest.mark.parametrize("name", PROGRAMS)
def test_each_program_tells_what_it_takes(name: str) -> None:
    assert CliRunner().invoke(main, [name, "--help"], catch_exceptions=False).exit_code == 0


def test_the_page_is_that_of_its_figures() -> None:
    figures = json.loads((ROOT / "docs/reliability.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs/reliability.md").read_text(encoding="utf-8")
    assert figures.keys() <= SECTIONS.keys()
    for name, measured in figures.items():
        assert "\n".join(SECTIONS[name].render(measured)) in page


def test_a_digest_is_of_value_kind_and_shape() -> None:
    found = set()
    for value in (1, 1.0, np.ones(1), np.ones((1, 1)), np.float32(1), "1", None):
        digests = Digests()
        digests.add("x", value)
        found.add(digests.found["x"])
    assert len(found) == 7
    again = Digests()
    again.add("x", np.ones(1))
    assert again.found["x"] in found


def test_faults_are_of_the_projects_own_modules() -> None:
    assert "albot_env/sim/laser.py" in modules()
    drawn = draw_faults(1, 0.02)
    assert drawn == draw_faults(1, 0.02)
    for fault in drawn:
        lines = (ROOT / fault.path).read_text(encoding="utf-8").splitlines()
        assert lines[fault.line - 1] == fault.old != fault.new
        assert fault in all_faults(fault.path)


def test_rounds_of_fuzzing_add_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Two rounds with one seed after the other; a reader whose process ended stays so."""
    seeds: list[int] = []

    def one_round(folder: Path, names: list[str], examples: int, jobs: int, seed: int) -> Any:
        seeds.append(seed)
        crash = {"IndexError at reader.py:7": 1} if seed == 6 else {}
        counts = {"read": 3, "refused": 4, "crashes": crash, "slowest": 0.1 * seed}
        ended = {"ended": "Segmentation fault"} if seed == 5 else counts
        return [(name, ended if name == names[1] else counts) for name in names]

    monkeypatch.setattr(fuzzing, "_round", one_round)
    clock = chain((0.0, 1.0), repeat(200.0))
    monkeypatch.setattr(fuzzing.time, "monotonic", lambda: next(clock))
    figures = fuzzing.fuzz(tmp_path, share=1.0, jobs=1, minutes=2.0, seed=5)
    assert seeds == [5, 6]
    names = list(figures["readers"])
    assert figures["readers"][names[0]] == {
        "read": 6,
        "refused": 8,
        "crashes": {"IndexError at reader.py:7": 1},
        "slowest": pytest.approx(0.6),
    }
    assert figures["readers"][names[1]] == {"ended": "Segmentation fault"}
    assert fuzzing.crashed(figures) == len(names)
    assert "seeds 5 to 6, 3 minutes" in "\n".join(fuzzing.render(figures))


def test_campaigns_are_those_of_the_documentation() -> None:
    for name in campaigns.CAMPAIGNS:
        read_campaign(ROOT / "docs/campaigns" / f"{name}.yml")
    figures = {
        "worlds": 12345, "agents": ["a", "b"], "episodes": 2, "steps": 3, "seconds": 1.0,
        "steps_per_second": 4567.8, "jobs": 2, "violations": 0,
    }  # fmt: skip
    row = list(campaigns.render({"all_worlds": figures}))[-1]
    command = "`albot stress docs/campaigns/all_worlds.yml --jobs 2`"
    assert row == f"| {command} | 12,345 | a, b | 2 | 3 | 4,568 | 0 |"
