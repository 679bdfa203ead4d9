"""Claims to have been somewhere before: which are right, and what they are worth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_env.tasks.explore.claims import (
    AGAIN,
    FALSE,
    MOST,
    NOTHING,
    RIGHT,
    ClaimingActionConfig,
    Claims,
    forget_claims,
    judge_claim,
)
from albot_env.tasks.explore.env import ExploreEnv
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import World

CLAIMING = ExploreConfig(actions=ClaimingActionConfig())
A, B, BETWEEN = 0, 1, -1


def _judged(*visits: tuple[int, int, int]) -> tuple[list[int], list[int]]:
    """What becomes of claims, made with every step, on visits (room, place, metres).

    Returns:
        The last step's judgement in each visit that was not nothing, and the counts.
    """
    claims = Claims(
        claims=np.ones(1, np.bool_),
        places=np.zeros(1, np.int64),
        met_in=np.zeros((1, MOST), np.int64),
        place=np.zeros(1, np.int64),
        since=np.zeros(1),
        room=np.zeros(1, np.int64),
        returned=np.zeros(1, np.bool_),
        judged=np.zeros(1, np.bool_),
        recognized=np.ones((1, 2), np.bool_),
        counts=np.ones((1, 3), np.int64),
    )
    forget_claims(0, claims)
    driven, entered, outcomes = 0.0, set(), []
    for room, place, metres in visits:
        claims.places[0], judged = place, [NOTHING]
        for _ in range(metres * 10):
            is_new = room >= 0 and room not in entered
            judged.append(judge_claim(0, room, is_new, driven, claims))
            entered.add(room)
            driven += 0.1
        outcomes.append(max(judged))
        assert sum(outcome != NOTHING for outcome in judged) <= 1  # Only the first counts.
    return outcomes, claims.counts[0].tolist()


@pytest.mark.parametrize(
    ("visits", "outcomes", "counts"),
    [
        # On a first visit every claim is false; back in A its place was met there.
        ([(A, 0, 3), (B, 1, 3), (A, 0, 3)], [FALSE, FALSE, RIGHT], [1, 1, 2]),
        # The mapper takes A for a new place, or for B.
        ([(A, 0, 3), (B, 1, 3), (A, 2, 3)], [FALSE, FALSE, FALSE], [1, 0, 3]),
        ([(A, 0, 3), (B, 1, 3), (A, 1, 3)], [FALSE, FALSE, FALSE], [1, 0, 3]),
        # A mapper that knows no places only says that it was in here before.
        ([(A, -1, 3), (B, -1, 3), (A, -1, 3)], [FALSE, FALSE, RIGHT], [1, 1, 2]),
        # The same room once more is right once more, and that is worth nothing.
        (
            [(A, 0, 3), (B, 1, 3), (A, 0, 3), (B, 1, 3), (A, 0, 3)],
            [FALSE, FALSE, RIGHT, RIGHT, AGAIN],
            [3, 3, 2],
        ),
        # Out into the doorway and back is no return.
        ([(A, 0, 3), (BETWEEN, 0, 1), (A, 0, 3)], [FALSE, NOTHING, NOTHING], [0, 0, 1]),
        # The other room too.
        (
            [(A, 0, 3), (B, 1, 3), (A, 0, 3), (B, 1, 3)],
            [FALSE, FALSE, RIGHT, RIGHT],
            [2, 2, 2],
        ),
        # Places beyond all that are kept account of are never right.
        (
            [(A, MOST, 3), (B, MOST + 1, 3), (A, MOST, 3)],
            [FALSE, FALSE, FALSE],
            [1, 0, 3],
        ),
    ],
)
def test_claims_by_hand(
    visits: list[tuple[int, int, int]], outcomes: list[int], counts: list[int]
) -> None:
    assert _judged(*visits) == (outcomes, counts)


def test_a_place_found_late_is_that_of_the_room_in_which_it_settles() -> None:
    """A metre into B the mapper still believes in A's place; a claim made before is false."""
    outcomes, _ = _judged((A, 0, 3), (B, 0, 1), (B, 1, 3), (A, 1, 1), (A, 0, 3), (B, 0, 1))
    assert outcomes == [FALSE, FALSE, NOTHING, FALSE, NOTHING, FALSE]


def _drive_to(env: ExploreEnv, x: float, claim: float = -1.0) -> list[dict[str, Any]]:
    """Straight on along the rooms, forwards or back, until there; the infos."""
    infos = []
    while True:
        ahead = x - env._robot.poses[0, 0]
        if abs(ahead) < 0.2:
            return infos
        infos.append(env.step(np.array((0.8 * np.sign(ahead), 0, claim), np.float32))[4])


@pytest.mark.parametrize("mapper", ["none", "odometry"])
def test_a_right_claim_is_worth_something_and_a_false_one_costs(
    two_rooms: World, mapper: str
) -> None:
    env = ExploreEnv(two_rooms, mapper=mapper, config=CLAIMING)
    assert env.action_space.shape == (3,)
    _, info = env.reset(seed=1, options={"start": 0})
    assert (info["re_entries"], info["right_claims"], info["false_claims"]) == (0, 0, 0)
    for x, claim, counts, worth in (
        (7.0, -1.0, (0, 0, 0), 0.0),  # Silent.
        (6.5, 1.0, (0, 0, 1), -1.0),  # The east is new.
        (3.0, -1.0, (1, 0, 1), 0.0),
        (2.0, 1.0, (1, 1, 1), 0.5),  # The west is not.
        (7.0, 1.0, (2, 2, 1), 0.5),
        (3.0, 1.0, (3, 3, 1), 0.0),  # The west was recognised before.
    ):
        infos = _drive_to(env, x, claim)
        info = infos[-1]
        assert (info["re_entries"], info["right_claims"], info["false_claims"]) == counts
        terms = [each["reward_terms"] for each in infos]
        earned = sum(term["place_recognized"] + term["place_mistaken"] for term in terms)
        assert earned == worth


def test_without_claims_nothing_is_claimed(two_rooms: World) -> None:
    env = ExploreEnv(two_rooms, mapper="none")
    assert env.action_space.shape == (2,)
    env.reset(seed=1, options={"start": 0})
    info = env.step(np.array((1, 1), np.float32))[4]
    assert info["false_claims"] == info["reward_terms"]["place_mistaken"] == 0
