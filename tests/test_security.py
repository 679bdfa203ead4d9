"""What SECURITY.md promises and no other test holds; and the tests that it names are there."""

from __future__ import annotations

import ast
import os
import re
import signal
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.processes import ALBOT, family, listening, running, wait_until

ROOT = Path(__file__).parent.parent
PACKAGES = (
    "core/albot_core", "maps/albot_maps", "albot_env", "agents/albot_agents", "scripts/albot_cli",
    "scripts/albot_experiments", "scripts/albot_studies", "scripts/albot_benchmarks",
    "scripts/albot_stress",
)  # fmt: skip
UNPICKLING = {"pickle", "cPickle", "_pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
CONNECTING = {
    "http.client", "http.server", "urllib.request", "requests", "httpx", "aiohttp", "socketserver",
    "ftplib", "xmlrpc.client",
}  # fmt: skip
CHECKS_AN_ADDRESS = "agents/albot_agents/engine/ray_cluster.py"
"""The only module with a socket: it looks whether anything answers where a cluster should be."""


class Module(NamedTuple):
    """What a module of ours imports and calls."""

    path: str
    imported: set[str]
    calls: list[tuple[str, dict[str, str]]]


@cache
def modules() -> list[Module]:
    """All our modules, read once."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    return [
        Module(path.relative_to(ROOT).as_posix(), imported(tree), list(calls(tree)))
        for path, tree in trees.items()
    ]


def imported(tree: ast.Module) -> set[str]:
    """All modules that a module imports, or from which it imports, within functions too."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    return found


def calls(tree: ast.Module) -> Iterator[tuple[str, dict[str, str]]]:
    """The name of each function that is called, and its named arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            named = {each.arg: ast.unparse(each.value) for each in node.keywords if each.arg}
            yield ast.unparse(node.func), named


def test_nothing_unpickles() -> None:
    for path, names, called in modules():
        assert not names & UNPICKLING, path
        for name, named in called:
            assert named.get("allow_pickle", "False") == "False", path
            assert name not in ("torch.load", "np.fromfile"), path
            if name == "np.load":
                assert named.get("allow_pickle") == "False", path


def test_nothing_runs_text_as_code() -> None:
    for path, _, called in modules():
        for name, _ in called:
            assert name not in ("eval", "exec", "compile", "__import__", "os.system"), path
            assert name not in ("yaml.load", "yaml.unsafe_load", "yaml.full_load"), path


def test_nothing_opens_a_connection() -> None:
    for path, names, _ in modules():
        assert not names & CONNECTING, path
        assert ("socket" in names) == (path == CHECKS_AN_ADDRESS), path


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells who listens")
def test_no_command_listens_on_a_port(tmp_path: Path) -> None:
    """Nor do its workers."""
    words = (*ALBOT, "stress", "--worlds", "square-loop", "--count", "100000", "--steps", "9",
             "--agent", "random", "--jobs", "2", "--json")  # fmt: skip
    with running(words, tmp_path) as process:
        wait_until(lambda: len(family(process.pid)) >= 3, 240)
        found = listening(process.pid)
        os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=60)
    assert found == set()


def test_the_tests_that_are_named_are_there() -> None:
    named = re.findall(r"`(tests/\S+\.py)::(\w+)`", (ROOT / "SECURITY.md").read_text())
    assert len(named) >= 10
    for file, name in named:
        assert f"\ndef {name}(" in (ROOT / file).read_text(), (file, name)
