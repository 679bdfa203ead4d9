"""That the test run's checks of arrays see what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError

from albot_core.geometry.poses import transform_points
from tests.checking import checked, is_told_by_kind


def _joined(a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
    return np.column_stack((a, b)) if b.any() else a


@dataclass(frozen=True)
class Pair:
    """Two of the same length."""

    first: Float[np.ndarray, " n"]
    second: Float[np.ndarray, " n"]


joined: Any = checked(_joined, typechecker=None)
pair: Any = checked(typechecker=None)(Pair)


@pytest.fixture(autouse=True)
def _met() -> None:
    """A call of each has passed, so that calls like it are not checked again."""
    for count in (4, 4, 3):
        joined(np.ones((count, 2)), np.ones(count))
        pair(np.ones(count), np.ones(count))
    transform_points(np.zeros(3), np.zeros((4, 2)))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: joined(np.ones((4, 3)), np.ones(4)),
        lambda: joined(np.ones((4, 2)), np.ones(4, int)),
        lambda: joined(np.ones((4, 2)), np.ones(3)),
        lambda: joined(np.ones((4, 2)), np.zeros(4)),  # The result has two columns.
        lambda: joined(a=np.ones((4, 2)), b=np.zeros(4)),
        lambda: joined(np.ones((4, 2)), b=np.ones(3)),
        lambda: joined(np.ones((4, 2)), [1.0] * 4),
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


class Place(NamedTuple):
    """A tuple with a name."""

    x: Any
    y: Any


def _between(both: tuple[Float[np.ndarray, " n"], float]) -> Float[np.ndarray, " n"]:
    return both[0]


def test_what_tuples_hold_is_looked_at_in_every_call() -> None:
    between: Any = checked(_between, typechecker=None)
    for both in ((np.ones(2), 1.0), Place(np.ones(2), 1.0)):
        assert between(both).shape == (2,)
    for wrong in ((np.ones(2), "1"), Place(np.ones(2), "1"), (np.ones(2, int), 1.0), (1.0, 1.0)):
        with pytest.raises(TypeCheckError):
            between(wrong)


def _chosen(of: Literal["first", "second"], a: Float[np.ndarray, " n"]) -> None: ...


def test_where_values_decide_every_call_is_checked() -> None:
    chosen: Any = checked(_chosen, typechecker=None)
    chosen("first", np.ones(2))
    with pytest.raises(TypeCheckError):
        chosen("third", np.ones(2))


@runtime_checkable
class Named(Protocol):
    """What a type's instances have or lack."""

    name: str

    def call(self) -> None: ...


def test_members_of_a_protocol_are_looked_for_and_not_worked_out() -> None:
    class Costly:
        call = print

        @property
        def name(self) -> str:
            raise RuntimeError("worked out")

    class Own:
        call = print

    own = Own()
    assert isinstance(Costly(), Named)
    assert not isinstance(own, Named)
    own.name = "a"  # type: ignore[attr-defined]
    assert isinstance(own, Named)
    assert not isinstance(type("Silent", (Own,), {"name": "a", "call": None})(), Named)
    assert not isinstance(1, Named)


@pytest.mark.parametrize(
    ("hint", "by_kind"),
    [
        (float | None, True),
        (Float[np.ndarray, "n 2"] | dict, True),
        (tuple[Float[np.ndarray, "2"], ...], True),
        (Callable[[int], int], True),
        (Pair, True),
        (Literal["a"], False),
        (Sequence[Float[np.ndarray, "2"]], False),
        (dict[str, int] | None, False),
        (tuple[Literal["a"], int], False),
        (Named, False),
        (Float[np.ndarray, "{size}"], False),  # It depends on an argument's value.
        (Float[Any, "n"], False),
    ],
)
def test_a_hint_is_told_by_kind_where_types_and_shapes_decide(hint: Any, by_kind: bool) -> None:
    assert is_told_by_kind(hint) == by_kind
