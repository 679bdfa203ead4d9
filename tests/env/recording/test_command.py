"""The command that makes an episode again makes it."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from albot_env.recording.command import play_command
from albot_env.recording.episode import EpisodeHeader


def _header(**kwargs: object) -> EpisodeHeader:
    return EpisodeHeader(
        environment="Albot/Explore-v0",
        world="w",
        walls=np.empty((0, 4)),
        start=np.zeros(3),
        mapper="albot1",
        odometer="pioneer",
        robot_radius=0.2,
        seed=7,
        agent="gap-explorer",
        spec={"id": "Albot/Explore-v0", "kwargs": kwargs},
    )


def test_settings_become_options() -> None:
    header = _header(world="my world.yaml", mapper="albot1", odometer="poor", movables=False)
    assert play_command(header, 90) == (
        "albot play Albot/Explore-v0 --world 'my world.yaml' --mapper albot1 --odometer poor "
        "--agent gap-explorer --no-movables --seed 7 --steps 90"
    )


def test_configurations_become_files_that_the_shell_writes(tmp_path: Path) -> None:
    config = {"weights": {"time": -0.5}, "name": "it's"}
    lines = play_command(_header(world="office", config=config), 5).splitlines()
    assert lines[-1].endswith("--config config.yml --agent gap-explorer --seed 7 --steps 5")
    subprocess.run(["sh", "-c", lines[0]], cwd=tmp_path, check=True)
    assert yaml.safe_load((tmp_path / "config.yml").read_text()) == config


@pytest.mark.parametrize(
    "changed",
    [{"world": ["a", "b"]}, {"observation": "dict", "world": "office"}, {"config": "a file"}],
)
def test_what_no_option_can_say_gives_no_command(changed: dict[str, object]) -> None:
    assert play_command(_header(**changed), 5) == ""


def test_an_episode_without_seed_spec_or_agent_gives_no_command() -> None:
    for changed in ({"seed": None}, {"spec": None}, {"agent": ""}, {"agent": "keyboard"}):
        assert play_command(replace(_header(world="office"), **changed), 5) == ""
