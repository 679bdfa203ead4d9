"""`albot agents` as people call it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from albot_agents.registry import AGENTS, agent_names
from albot_agents.trained.trained_agent import shipped_agents
from albot_cli.group import albot
from albot_core.errors import InputError
from tests.cli.conftest import figures


def test_the_list_names_all_agents_and_the_cards_of_trained_ones(
    call: Callable[..., Result],
) -> None:
    rows = {row["name"]: row for row in figures(call("agents", "list", "--json"))["agents"]}
    assert tuple(rows) == agent_names()
    assert {name for name, row in rows.items() if "card" in row} == set(shipped_agents())
    assert {name for name, row in rows.items() if row["knows_truth"]} == {"oracle"}
    for name, row in rows.items():
        assert row["summary"]
        assert row["mapper"]
        if name not in AGENTS:
            assert row["task"] in row["summary"]
            assert Path(row["card"]).read_text(encoding="utf-8").startswith(f"# {name}")
    lines = call("agents", "list").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(rows)
    for line, row in zip(lines, rows.values(), strict=True):
        assert line.endswith(row.get("card", row["summary"]))


@pytest.mark.parametrize("name", ["c.png", "c2"])
def test_a_card_of_another_name_than_md_is_refused(tmp_path: Path, name: str) -> None:
    words = ["agents", "card", str(shipped_agents()["homing"]), "--out", str(tmp_path / name)]
    with pytest.raises(
        InputError, match=r"^--out: expected a name that ends in \.md, found .*"
    ) as e:
        CliRunner().invoke(albot, words, catch_exceptions=False)
    assert str(tmp_path / name) in str(e.value)
    assert not list(tmp_path.iterdir())


def test_a_file_of_another_kind_is_told_first(episode_file: Path) -> None:
    """Not that the picture beside it exists."""
    episode_file.with_suffix(".png").touch()
    words = ["agents", "card", str(episode_file)]
    with pytest.raises(InputError) as caught:
        CliRunner().invoke(albot, words, catch_exceptions=False)
    expected = "expected the file of a trained agent, found a recorded episode"
    assert str(caught.value) == f"{episode_file}: {expected}"


def test_a_figure_is_none_of_the_files_beside_it(tmp_path: Path) -> None:
    agent = shutil.copy(shipped_agents()["homing"], tmp_path / "a.albot")
    for words in (("card", agent), ("curve", agent, "--out", tmp_path)):
        figure = tmp_path / ("a.png" if words[0] == "card" else "curve.png")
        result = CliRunner().invoke(albot, ["agents", *map(str, words), "--figure", str(figure)])
        assert isinstance(result.exception, InputError)
        assert "--figure: expected a file other than those" in str(result.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["a.albot"]


@pytest.mark.parametrize("name", ["a.md", "a.png"])
def test_a_card_does_not_overwrite_its_agent(tmp_path: Path, name: str) -> None:
    agent = tmp_path / name
    agent.write_bytes(shipped_agents()["homing"].read_bytes())
    before = agent.read_bytes()
    with pytest.raises(InputError, match=r"^--out: expected another file than the agent's"):
        CliRunner().invoke(albot, ["agents", "card", str(agent), "--force"], catch_exceptions=False)
    assert agent.read_bytes() == before
    assert list(tmp_path.iterdir()) == [agent]
