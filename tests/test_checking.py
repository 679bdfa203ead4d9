"""That the test run's checks of arrays see what is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError

from albot_core.geometry.poses import transform_points
from tests.checking import checked


def _joined(a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
    return np.column_stack((a, b)) if b.any() else a


@dataclass(frozen=True)
class Pair:
    """Two of the same length."""

    first: Float[np.ndarray, " n"]
    second: Float[np.ndarray, " n"]


joined: Any = checked(_joined, typechecker=None)
pair: Any = checked(typechecker=None)(Pair)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: joined(np.ones((4, 3)), np.ones(4)),
        lambda: joined(np.ones((4, 2)), np.ones(4, int)),
        lambda: joined(np.ones((4, 2)), np.ones(3)),
        lambda: joined(np.ones((4, 2)), np.zeros(4)),  # The result has two columns.
        lambda: pair(np.ones(4), np.ones(3)),
        lambda: transform_points(np.zeros(2), np.zeros((4, 2))),  # As the hook wraps our own.
    ],
)
def test_what_is_of_another_kind_or_shape_is_refused(wrong: Any) -> None:
    with pytest.raises(TypeCheckError):
        wrong()


def test_each_call_has_lengths_of_its_own() -> None:
    for count in (4, 3):
        assert joined(np.ones((count, 2)), np.ones(count)).shape == (count, 3)
    assert pair(np.ones(4), np.ones(4)).first.shape == (4,)
