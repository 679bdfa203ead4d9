"""What an environment's settings may be."""

from __future__ import annotations

import gymnasium
import pytest

from albot_core.errors import InputError


def test_of_an_unknown_mapper_it_is_said_that_there_may_be_none() -> None:
    with pytest.raises(InputError, match=r"^mapper: expected none or one of albot0, albot0-paper"):
        gymnasium.make("Albot/Explore-v0", mapper="albot9")
