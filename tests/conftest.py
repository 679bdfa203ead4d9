"""The test run checks every array's shape: jaxtyping's import hook with beartype."""

from __future__ import annotations

import gc
import os

# Processes of tests share the processors. Threads of OpenMP, as PyTorch's and numpy's, would wait
# for one another at full load: a training of a second took ten.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# What a process of a test has made of our source is there for the next one, as compiled code is.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import signal
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import jaxtyping
import pytest

from tests.checking import checked

gc.disable()  # Until all is loaded: it would visit again and again what only grows.
ROOT = Path(__file__).parents[1]
SOURCES = {
    "albot_core": ROOT / "core",
    "albot_maps": ROOT / "maps",
    "albot_env": ROOT,
    "albot_agents": ROOT / "agents",
    "albot_experiments": ROOT / "scripts",
    "albot_benchmarks": ROOT / "scripts",
    "albot_stress": ROOT / "scripts",
    "albot_cli": ROOT / "scripts",
}
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FIRST = (
    "core/mappers/albot1/test_batch.py",
    "env/tasks/test_action.py",
    "core/matching/test_panorama.py",
    "env/tasks/test_place_recognition.py",
)
"""What compiles longest: mapper and panoramas on the one side, simulator and tasks on the other.
Two processes that begin with these in turn compile half each, and load the other's half."""
FILL = ("maps", "reliability", "stress", "studies")
"""Folders of many short tests. They come last, behind the files beside this one, some of which take
a minute: in the end no process waits long for the other."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What compiles comes first, and what is short comes last."""
    folder = Path(__file__).parent
    places = {folder / name: place for place, name in enumerate(FIRST)}

    def place(item: pytest.Item) -> int:
        parts = item.path.relative_to(folder).parts
        return places.get(item.path, len(FIRST) + (parts[0] in FILL))

    items.sort(key=place)


def pytest_collection_finish() -> None:
    """What is loaded stays to the end, so the garbage collector need not visit it each time."""
    from albot_core.garbage import collect_rarely  # Behind the hook.

    gc.freeze()
    collect_rarely()
    gc.enable()


@pytest.fixture(autouse=True)
def _signals_as_before() -> Iterator[None]:
    """The command leaves as few handlers of signals behind as suits a process that ends."""
    before = {number: signal.getsignal(number) for number in _ENDING}
    yield
    for number, handler in before.items():
        if signal.getsignal(number) is not handler:
            signal.signal(number, handler)


def _checked_modules() -> list[str]:
    """Every module of ours but those with compiled functions, which take no decorator."""
    modules = []
    for package, folder in SOURCES.items():
        for path in sorted((folder / package).rglob("*.py")):
            if path.name != "__init__.py" and not _compiles(path):
                relative = path.relative_to(folder).with_suffix("")
                modules.append(".".join(relative.parts))
    return modules


def _compiles(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    return "numba" in text or "albot_core.kernels.compiled" in text


# What a kernel takes to compile at its first example is no failure. Where CI is set, the examples
# are the same in each run, so that a red run can be repeated; elsewhere new ones are tried.
# Ray reads these once, when whichever test comes first imports it.
os.environ.setdefault("RAY_AUTH_MODE", "token")
os.environ.setdefault("RAY_AUTH_TOKEN", "0" * 64)
os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
os.environ.setdefault("RAY_worker_niceness", "0")  # By default, they wait for all other tests.
hypothesis.settings.register_profile(
    "albot", max_examples=50, deadline=None, derandomize="CI" in os.environ
)
hypothesis.settings.load_profile("albot")

jaxtyping.jaxtyped = checked  # What the hook puts before every function and class.
_HOOK = jaxtyping.install_import_hook(_checked_modules(), "beartype.beartype")


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real logs and floor plans, named by ALBOT_DATA."""
    folder = os.environ.get("ALBOT_DATA")
    if not folder:
        pytest.skip("ALBOT_DATA names no folder of real logs and floor plans")
    return Path(folder)
