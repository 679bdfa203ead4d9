"""Claims: actions that say "I have been here before"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from albot_env.tasks.action import DeclaringActionConfig


@dataclass(frozen=True, kw_only=True)
class ClaimingActionConfig(DeclaringActionConfig):
    """Speed and turn rate, and a third number that claims to know the present place."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "claim")
