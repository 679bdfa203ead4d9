"""The developers' programs: both are there, and digests change with a value, its kind or shape."""

from __future__ import annotations

import json
import os
from unittest.mock import patch

import numpy as np
import pytest
from click.testing import CliRunner

from albot_reliability.__main__ import PROGRAMS, main
from albot_reliability.digests import Digests
from albot_reliability.fault_sampling import ROOT, all_faults, draw_faults, modules

with patch.dict(os.environ):  # It limits the threads of all that is loaded after it.
    from albot_reliability.page import SECTIONS


@pytest.mark.parametrize("name", PROGRAMS)
def test_each_program_tells_what_it_takes(name: str) -> None:
    assert CliRunner().invoke(main, [name, "--help"], catch_exceptions=False).exit_code == 0


def test_the_page_is_that_of_its_figures() -> None:
    figures = json.loads((ROOT / "docs/reliability.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs/reliability.md").read_text(encoding="utf-8")
    for name, section in SECTIONS.items():
        assert "\n".join(section.render(figures[name])) in page


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
