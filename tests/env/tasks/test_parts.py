"""What every part of observations promises, and that what is told of parts follows from them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig
from albot_env.tasks.core.observation_kernels import PARTS, Layout
from albot_env.tasks.core.parts.part import Need
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from tests.env.quick import LOOP

ROOT = Path(__file__).parents[3]
CONFIG = ObservationConfig(parts=PART_NAMES, has_compass=True)


def test_the_layout_has_the_parts_in_their_order_one_after_another() -> None:
    assert Layout._fields == PART_NAMES
    begins = [*CONFIG.layout, CONFIG.flat_space.shape[0]]
    lengths = [int(np.prod(CONFIG.shapes[name])) for name in PART_NAMES]
    assert np.diff(begins).tolist() == lengths
    few = ObservationConfig(parts=("home", "laser")).layout._asdict()
    assert {name for name, begin in few.items() if begin >= 0} == {"home", "laser"}


@pytest.mark.parametrize("name", PART_NAMES)
def test_a_part_is_filled_in_wholly_and_can_be_decoded(name: str) -> None:
    """By itself, and as beside all others: what it needs is worked out for it alone."""
    part = PARTS[PART_NAMES.index(name)]
    shown = []
    for parts in ((name,), PART_NAMES):
        observations = replace(CONFIG, parts=parts)
        config = ExploreAndHomeConfig(observations=observations, hints=True, claims=False)
        settings = {"world": LOOP, "config": config, "compass": "polarised"}
        env = gymnasium.make("Albot/ExploreAndHomeRevealed-v1", **settings)
        env.unwrapped._robot.observations[:] = np.nan  # type: ignore[attr-defined]
        env.reset(seed=1)
        for _ in range(12):
            observation, *_ = env.step(np.array((0.8, 0.1, -1), np.float32))
        seen = env.get_wrapper_attr("observation_config")
        shown.append(seen.split(observation)[name])
        assert np.isfinite(shown[-1]).all()
        assert seen.decode(part, observation) is not NotImplemented
        env.close()
    np.testing.assert_array_equal(*shown)


def test_what_no_observed_part_needs_is_not_worked_out() -> None:
    for part in PARTS:
        config = ObservationConfig(parts=(part.name,))
        assert {need for need in Need if config.needs(need)} == part.needs


def test_the_table_of_parts_in_the_documents_is_that_of_their_objects() -> None:
    text = (ROOT / "docs/environments.md").read_text(encoding="utf-8")
    first = text.index("| part | numbers | meaning |")
    table = text[first : text.index("\n\n", first)].splitlines()
    assert table[2:] == [part.row for part in PARTS]
