"""Damaged files: each reader reads what it can, or says in one clear error what is wrong."""

from __future__ import annotations

import ast
import inspect
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzzing.fuzz import Fuzz
from tests.fuzzing.readers import READERS

PACKAGES = {
    "albot_core": "core", "albot_maps": "maps", "albot_env": ".", "albot_agents": "agents",
    "albot_cli": "scripts",
}  # fmt: skip


@pytest.fixture(scope="module", params=READERS, ids=lambda reader: reader.name)
def fuzz(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Fuzz:
    """A reader with whole files of its kind."""
    return Fuzz(request.param, tmp_path_factory.mktemp("fuzz"))


def test_whole_files_are_read(fuzz: Fuzz) -> None:
    assert fuzz.attempt({}) is None


def _texts(fuzz: Fuzz) -> dict[str, str]:
    """What the text files of a reader hold; of those that people write."""
    found = {}
    if fuzz.reader.name.startswith(("spec ", "run folder")):
        return found  # A spec is no file; a run's files are its own.
    for name, content in fuzz.files.items():
        with suppress(UnicodeDecodeError):
            if content and "\0" not in content.decode():
                found[name] = content.decode()
    return found


def test_a_byte_order_mark_before_any_text_is_no_matter(fuzz: Fuzz) -> None:
    texts = _texts(fuzz)
    assert fuzz.attempt({name: f"\ufeff{text}".encode() for name, text in texts.items()}) is None


def test_text_in_another_encoding_is_told(fuzz: Fuzz) -> None:
    for name, text in _texts(fuzz).items():
        if not name.endswith(".xml"):  # An XML parser reads it.
            error = fuzz.attempt({name: text.encode("utf-16")})
            assert error is not None
            assert "expected UTF-8 text, found UTF-16 text; convert it" in str(error)


def test_damaged_files_are_read_or_refused(fuzz: Fuzz) -> None:
    @settings(
        max_examples=fuzz.reader.examples,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.data())
    def damage(data: Any) -> None:
        fuzz.attempt(fuzz.damaged(data.draw))

    damage()


def _reads(node: ast.FunctionDef) -> bool:
    annotations = [ast.unparse(each.annotation) for each in node.args.args if each.annotation]
    return node.name.startswith(("read_", "load_")) and any("Path" in kind for kind in annotations)


def test_every_function_that_reads_a_file_stands_in_the_list() -> None:
    root = Path(__file__).parents[2]
    known = {inspect.unwrap(each) for reader in READERS for each in reader.functions}
    names = {f"{each.__module__}.{each.__name__}" for each in known}
    missing = []
    for package, folder in PACKAGES.items():
        for path in sorted((root / folder / package).rglob("*.py")):
            module = ".".join(path.relative_to(root / folder).with_suffix("").parts)
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                name = f"{module}.{getattr(node, 'name', '')}"
                if isinstance(node, ast.FunctionDef) and _reads(node) and name not in names:
                    missing.append(name)
    assert not missing
