"""`albot agents card` as people call it."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from albot_agents.trained.trained_agent import shipped_agents
from albot_cli.group import albot
from albot_core.errors import InputError


@pytest.mark.parametrize("name", ["c.png", "c2"])
def test_a_card_of_another_name_than_md_is_refused(tmp_path: Path, name: str) -> None:
    words = ["agents", "card", str(shipped_agents()["homing"]), "--out", str(tmp_path / name)]
    with pytest.raises(
        InputError, match=r"^--out: expected a name that ends in \.md, found .*"
    ) as e:
        CliRunner().invoke(albot, words, catch_exceptions=False)
    assert str(tmp_path / name) in str(e.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.md", "a.png"])
def test_a_card_does_not_overwrite_its_agent(tmp_path: Path, name: str) -> None:
    agent = tmp_path / name
    agent.write_bytes(shipped_agents()["homing"].read_bytes())
    before = agent.read_bytes()
    with pytest.raises(InputError, match=r"^--out: expected another file than the agent's"):
        CliRunner().invoke(albot, ["agents", "card", str(agent), "--force"], catch_exceptions=False)
    assert agent.read_bytes() == before
    assert list(tmp_path.iterdir()) == [agent]
