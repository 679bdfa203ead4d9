"""docs/benchmark.md says what the protocol is."""

from __future__ import annotations

from albot_agents.benchmark.protocol import find_protocol
from tests.conftest import ROOT

PAGE = " ".join((ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8").split())
PROTOCOL = find_protocol()


def test_the_page_has_the_protocols_seeds_odometers_worlds_and_budgets() -> None:
    for name, title in (
        ("training", "training"),
        ("validation", "validation"),
        ("test", "the test"),
    ):
        first, last = getattr(PROTOCOL.seeds, name).split("..")
        assert f"| seeds of {title} | {first} to {last} |" in PAGE
    first, *others = PROTOCOL.odometers
    assert (
        f"| `{first}` in the first table; {' and '.join(f'`{each}`' for each in others)} |" in PAGE
    )
    assert all(f"`{kind}`" in PAGE for kind in PROTOCOL.worlds)
    budgets = [f"{budget // 1_000_000}" for budget in PROTOCOL.budgets]
    assert f"| {', '.join(budgets[:-1])} and {budgets[-1]} million samples |" in PAGE


def test_the_page_has_the_number_of_episodes() -> None:
    plans = PROTOCOL.keys("Albot/Homing-v0", "plans")
    each = len(plans) // len(PROTOCOL.worlds["plans"].files or ())
    assert f"{PROTOCOL.episodes} episodes, {len(plans)} on the floor plans ({each} in each)" in PAGE
    last = plans[-1].seed
    assert f"The floor plans are run with the seeds 70000 to {last}." in PAGE


def test_the_page_names_every_task() -> None:
    named = [task for task in PROTOCOL.tasks if f"`{task}`" in PAGE]
    probes = [task for task in PROTOCOL.tasks if "Probe" in task]
    assert len(named) + len(probes) == len(PROTOCOL.tasks)
    assert len(probes) == 5
    assert "the five probes" in PAGE
