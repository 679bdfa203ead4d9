"""Faults put by hand into the papers' mechanisms: each is of today's source, and each is seen."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from albot_core.errors import InputError
from albot_experiments.mutation_table import FILE, mutation_lines, read_mutations
from albot_reliability import mutations
from albot_reliability.__main__ import main
from albot_reliability.fault_sampling import ROOT
from albot_reliability.mutations import read_cases, systems

FIGURES = ROOT / "docs" / "experiments" / FILE
CASE = """
paper: A paper
tests: [tests/core/test_counts.py]
experiments: {}
mutations:
  - {fault: Broken, file: core/albot_core/counts.py, find: "%s", replace: "%s"}
"""


@pytest.mark.parametrize("name", systems())
def test_the_figures_are_of_all_faults_and_each_is_seen(name: str) -> None:
    found = read_mutations(FIGURES)[name].mutations
    changes = [(each.fault, each.file, each.old, each.new) for each in found]
    cases = read_cases(name).mutations
    assert changes == [(each.fault, each.file, each.find, each.replace) for each in cases]
    assert len(cases) >= 10
    unseen = [each.fault for each in found if each.test is None and not each.verdicts]
    assert not unseen


def test_the_page_has_the_table() -> None:
    page = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    assert "\n".join(mutation_lines(read_mutations(FIGURES))) in page
    assert not mutation_lines({})


def test_a_fault_is_put_in_a_copy_and_its_tests_run(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(mutations, "CASES", tmp_path)
    (tmp_path / "a.yml").write_text(CASE % ("count == 1 else", "count == 2 else"))
    out = tmp_path / "figures.json"
    out.write_text(json.dumps({"b": {"paper": "Another", "mutations": []}}))
    before = (ROOT / "core/albot_core/counts.py").read_bytes()
    arguments = ["mutations", "a", "--jobs", "1", "--out", str(out)]
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    (found,) = read_mutations(out)["a"].mutations
    assert found.test is not None
    assert found.test.startswith("tests/core/test_counts.py::")
    assert list(read_mutations(out)) == ["a", "b"]
    assert (ROOT / "core/albot_core/counts.py").read_bytes() == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CASE % ("no such text", ""), "counts.py: expected the text 'no such text' once"),
        (CASE.replace("find", "finds") % ("", ""), "a.yml, line 6.*finds"),
        (CASE.replace("{}", "{albot9-1: 2}") % (r"from __future__ import", ""), "albot9-1"),
        (CASE.replace("counts.py,", "none.py,") % ("a", "b"), "none.py"),
        (
            CASE.replace("{}", "{albot1-c1: 0}") % ("from __future__ import", ""),
            "albot1-c1: expected .* seeds, found 0",
        ),
    ],
)
def test_damaged_faults_are_refused(tmp_path: Path, monkeypatch, text: str, message: str) -> None:
    monkeypatch.setattr(mutations, "CASES", tmp_path)
    (tmp_path / "a.yml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_cases("a")
    with pytest.raises(InputError, match="one of a"):
        read_cases("b")
