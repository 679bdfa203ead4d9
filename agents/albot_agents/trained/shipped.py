"""The trained agents that come with the project: the files beside this one."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from albot_agents.trained.agent_file import SUFFIX

_FOLDER = Path(str(resources.files("albot_agents.trained")))


def shipped_agents() -> dict[str, Path]:
    """Their files by name, in the order of the alphabet."""
    files = {path.stem: path for path in _FOLDER.glob(f"*{SUFFIX}")}
    return dict(sorted(files.items()))


def card_of(name: str) -> Path:
    """The model card of one of them."""
    return _FOLDER / f"{name}.md"
