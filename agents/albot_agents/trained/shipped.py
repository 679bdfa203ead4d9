"""The trained agents that come with the project: the files beside this one."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from albot_agents.trained.agent_file import SUFFIX


def shipped_agents() -> dict[str, Path]:
    """Their files by name, in the order of the alphabet."""
    folder = Path(str(resources.files("albot_agents.trained")))
    return {path.name.removesuffix(SUFFIX): path for path in sorted(folder.glob(f"*{SUFFIX}"))}
