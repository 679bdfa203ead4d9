"""The schema of a state: what it refuses, what is told of it, and that all else comes back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.schema import LONGEST, Field, Pack, Schema, generator, lead_out
from albot_core.mappers.stored import Stored
from tests.core.mappers.topological import TopologicalMapper

FAR = 1e4
"""Where a map may lie (m), far beyond the length of any of its lines."""
LINES = Schema(Field("surfaces", "surfaces 4", finite=False, lengths=(0, LONGEST)))


@pytest.mark.parametrize(
    "line",
    [
        (0, 0, LONGEST, 0),
        (FAR, FAR, FAR + 0.6 * LONGEST, FAR + 0.8 * LONGEST),
        (0, -FAR, 0, LONGEST - FAR),
        (np.nan, np.nan, np.nan, np.nan),
    ],
)
def test_a_line_may_lie_anywhere(line):
    assert LINES.check({"surfaces": np.array((line, (0, 0, 1, 1)), float)}) == {"surfaces": 2}
    assert LINES.check({"surfaces": np.empty((0, 4))}) == {"surfaces": 0}


@pytest.mark.parametrize(
    "line",
    [
        (-LONGEST, 0, 1, 0),
        (-0.6 * LONGEST, -0.8 * LONGEST, 1, 0),
        (FAR, -LONGEST, FAR, 1),
    ],
)
def test_a_line_that_is_too_long_is_refused(line):
    length = np.hypot(line[2] - line[0], line[3] - line[1])
    with pytest.raises(InputError, match=f"of {LONGEST:g} m at most") as refused:
        LINES.check({"surfaces": np.array(((0, 0, 1, 1), (np.nan, 0, 0, 0), line), float)})
    assert (refused.value.source, refused.value.found) == ("surfaces", f"{length:g} m")


class Part(Stored):
    """One of each kind of field."""

    SCHEMA = Schema(
        Pack("counts", int, Field("visits", least=0), Field("is_lost", "", bool)),
        Field("poses", "visits+1 3"),
        Field("before", "visits+1", int, least=-1, below="row"),
        Field("ends", "links 2", int, least=0, below="2*links"),
        Field("sizes", "visits+1", int, at="_lengths", least=0, sums="points"),
        Field("points", "points", above=0, most="reach"),
        Field("stamps", "visits+1", rising=True, finite=False),
        Field("ids", "visits+1", int, once=True),
        Field("store", "links", used="_used"),
        generator("rng"),
    )

    def __init__(self, visits: int = 0, links: int = 0) -> None:
        rng = self._rng = np.random.default_rng(visits)
        self._visits, self._is_lost, self._used = visits, bool(visits % 2), links
        self._poses = list(rng.normal(size=(visits + 1, 3)))
        self._before = list(range(-1, visits))
        self._ends = np.arange(2 * links).reshape(-1, 2)
        self._lengths = np.arange(visits + 1)
        self._points = rng.uniform(1.0, 5.0, self._lengths.sum())
        self._stamps = (*np.sort(rng.normal(size=visits)).tolist(), np.inf)
        self._ids = rng.permutation(visits + 1)
        self._store = np.arange(2.0 * links)


def checked(part: Part, state: dict[str, np.ndarray]) -> None:
    part.SCHEMA.check(state, reach=5.0)


@given(visits=st.integers(0, 5), links=st.integers(0, 4))
def test_what_is_restored_is_the_same(visits, links):
    part, again = Part(visits, links), Part(3, 2)
    state = part.state()
    checked(part, state)
    again._set_state(state)
    for name, array in again.state().items():
        assert array.dtype == state[name].dtype
        np.testing.assert_array_equal(array, state[name], err_msg=name)
    for name, value in vars(part).items():
        assert type(getattr(again, name)) is type(value), name
    assert again._rng.random() == part._rng.random()
    again._poses[0][0] = 99.0
    assert state["poses"][0, 0] != 99.0


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("counts", lambda a: a * 0 - 1, "poses|counts"),
        (
            "counts",
            lambda a: a + np.array((0, 1)),
            "counts: expected is_lost: whole numbers from 0 to 1",
        ),
        ("counts", lambda a: a + 1, "shape"),
        ("counts", lambda a: a[:1], r"counts: expected shape \(2,\)"),
        ("poses", lambda a: a[1:], r"poses: expected shape \(4, 3\), \(visits\+1 3\), found \(3"),
        ("poses", lambda a: a[0], "poses: expected 2 dimensions of float64, found 1 of float64"),
        ("poses", lambda a: a.astype(np.float32), "2 dimensions of float64, found 2 of float32"),
        ("poses", lambda a: a * np.nan, "poses: expected finite numbers"),
        ("poses", lambda a: a * 1e13, "poses: expected numbers within"),
        ("before", lambda a: a + 1, "before: expected whole numbers from -1 to less than row"),
        ("before", lambda a: a - 1, "before: expected whole numbers from -1"),
        ("ends", lambda a: a + 1, "ends: expected whole numbers from 0 to less than 4, found 4"),
        ("ends", lambda a: a + 2**60, "ends: expected numbers within"),
        ("sizes", lambda a: a + 1, "sizes: expected numbers that add up to"),
        ("points", lambda a: a * 0, "points: expected numbers above 0 to 5.0, found 0"),
        ("points", lambda a: a + 5, "points: expected numbers above 0 to 5"),
        ("stamps", lambda a: a[::-1], "stamps: expected numbers that never fall"),
        ("ids", lambda a: a * 0, "ids: expected each once"),
        ("rng", lambda a: a | np.uint64(2**40), "rng: expected whole numbers"),
    ],
)
def test_damage_is_refused(name, damage, message):
    part = Part(3, 2)
    state = part.state()
    checked(part, state)
    state[name] = damage(state[name])
    with np.errstate(invalid="ignore"), pytest.raises(InputError, match=message):
        checked(part, state)


def test_arrays_that_are_missing_or_unknown_are_refused():
    state = Part(3, 2).state()
    with pytest.raises(InputError, match="other: expected only before, counts"):
        checked(Part(), state | {"other": np.zeros(3)})
    del state["ids"]
    with pytest.raises(InputError, match="ids: expected the array ids, found none"):
        checked(Part(), state)


@pytest.mark.parametrize(
    ("following", "ends"),
    [([], True), ([-1], True), ([0], False), ([1, 2, -1], True), ([1, 0, -1], False)],
)
def test_ways_lead_out_unless_one_runs_in_a_circle(following, ends):
    assert lead_out(np.array(following, np.int64)) is ends


def test_the_guides_mapper_refuses_what_it_cannot_have_returned():
    mapper = TopologicalMapper()
    state = mapper.state()
    for name, wrong in (
        ("pose", np.full(3, np.nan)),
        ("history", np.zeros(1, np.int64)),
        ("links", np.zeros((1, 2), np.int64)),
        ("counts", np.array((-1, 0, -1, 0))),
    ):
        with pytest.raises(InputError, match=name):
            mapper.restore(state | {name: wrong})
