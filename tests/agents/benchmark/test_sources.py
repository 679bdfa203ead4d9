"""The digest of sources: what moves it and what does not."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from albot_agents.benchmark import sources
from albot_agents.benchmark.entrant import find_entrant, installed_sources
from albot_agents.benchmark.sources import source_digest
from tests.agents.benchmark.episodes import cell

CODE = '''"""A mapper."""
import numpy
from otherwise.parts import SIZE


class Mine:
    """It maps."""

    width: float = 0.5
    """How wide (m)."""

    def update(self) -> float:
        return self.width * SIZE  # As wide.
'''
Digest = Callable[[str, str], str]


@pytest.fixture
def digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Digest]:
    """The digest of a package's module, given its text and that of the module that it imports."""
    package = tmp_path / "otherwise"
    package.mkdir()
    (package / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)

    def of(code: str, parts: str = "SIZE = 2\n") -> str:
        (package / "mine.py").write_text(code)
        (package / "parts.py").write_text(parts)
        sources._module.cache_clear()
        return source_digest(["otherwise.mine"])

    yield of
    for name in [name for name in sys.modules if name.startswith("otherwise")]:
        del sys.modules[name]
    sources._module.cache_clear()


def test_comments_docstrings_and_layout_do_not_move_it(digest: Digest) -> None:
    told = CODE.replace("It maps.", "It maps\n    well.").replace("  # As wide.", "")
    told = told.replace('"""How wide (m)."""', "").replace(
        "self.width * SIZE", "(self.width *SIZE)"
    )
    assert digest(CODE) == digest(told)


@pytest.mark.parametrize(
    ("old", "new"), [("0.5", "0.6"), ("* SIZE", "+ SIZE"), ("update", "renew"), ("float", "int")]
)
def test_code_moves_it(digest: Digest, old: str, new: str) -> None:
    assert digest(CODE) != digest(CODE.replace(old, new))


def test_what_it_imports_moves_it_and_other_distributions_do_not(digest: Digest) -> None:
    assert digest(CODE) != digest(CODE, "SIZE = 3\n")
    assert digest(CODE) == digest(CODE, '"""Sizes."""\nSIZE = 2  # metres\n')


def test_each_mapper_and_agent_has_its_own() -> None:
    agents = ("albot1-homing", "hint-follower", "gap-explorer", "homing", "random", "place-judge")
    found = {name: find_entrant(name).sources for name in agents}
    assert len(set(found.values())) == len(agents)
    # Trained agents differ in their weights; what computes their networks is the same.
    assert find_entrant("homing").sources == find_entrant("homing-blind").sources
    # A scripted agent of trained ones moves with their weights.
    made = find_entrant("explore-and-home")
    assert made.entry.skills == ("exploring", "homing")


def test_what_computes_networks_moves_trained_agents_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    agents = ("homing", "homing-lstm", "explore-and-home", "gap-explorer", "albot1-homing")
    before = [find_entrant(name).sources for name in agents]
    read = sources._module

    def edited(name: str) -> tuple[str, tuple[str, ...]] | None:
        found = read(name)
        is_kernel = name == "albot_agents.trained.network_kernels" and found is not None
        return ("edited", found[1]) if is_kernel else found

    monkeypatch.setattr(sources, "_module", edited)
    after = [find_entrant(name).sources for name in agents]
    moved = [one != other for one, other in zip(before, after, strict=True)]
    assert moved == [True, True, True, False, False]


def test_a_cell_knows_the_installed_sources() -> None:
    entrant = find_entrant("albot1-homing")
    assert installed_sources(cell(), None) == entrant.sources
    assert installed_sources(cell("mine"), None) is None
    assert installed_sources(cell(mapper="lost"), None) is None
    assert installed_sources(cell("mine-01234567"), "ab") == find_entrant("homing").sources
