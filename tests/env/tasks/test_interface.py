"""Actions of a single robot on their way from the user to the robot."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from tests.env.quick import LOOP


def test_a_discrete_action_is_that_row_of_the_choices() -> None:
    envs = [
        gymnasium.make("Albot/Explore-v0", world=LOOP, mapper="none", action=form)
        for form in ("discrete", "continuous")
    ]
    choices = envs[0].get_wrapper_attr("action_config").choices
    for env in envs:
        env.reset(seed=1)
    for choice in (0, 2, 5, 7):
        infos = [
            env.step(action)[-1]
            for env, action in zip(envs, (np.int64(choice), choices[choice]), strict=True)
        ]
        np.testing.assert_array_equal(infos[0]["pose"], infos[1]["pose"])
    with pytest.raises(InputError, match="Explore-v0, action: expected a whole number from 0 to"):
        envs[0].step(np.int64(len(choices)))
