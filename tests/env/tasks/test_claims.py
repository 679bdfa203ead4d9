"""Claims to have been somewhere before: which are right, and what they are worth."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_env.tasks.core.claims import (
    AGAIN,
    FALSE,
    NOTHING,
    RIGHT,
    SETTLED,
    ClaimJudge,
    claim_outcome,
    judge_claim,
    no_claims,
    with_room,
)
from albot_env.tasks.explore.env import ExploreEnv
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.tasks.homing.env import HomingEnv
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World
from albot_maps.same_place import NO_BARRIERS, with_barriers
from tests.env.quick import LOOP

A, B, BETWEEN = 0, 1, -1
NOWHERE = -1
"""In place of a matched reading: none."""
ROOMS = {A: 2.0, B: 8.0, BETWEEN: 5.0}
"""Where a robot is that is in the two rooms, or between them (x, m)."""


def _judged(world: World, *visits: tuple[int, int, int]) -> tuple[list[int], list[int]]:
    """What becomes of claims, made with every step, on visits (room, matched reading, readings).

    Returns:
        The judgement in each visit that was not nothing, and the counts.
    """
    claims = no_claims(1, matches=True)
    claims = with_room(claims, sum(readings for *_, readings in visits), 2)
    claims = claims._replace(barriers=with_barriers(NO_BARRIERS, world))
    claims.claims[:] = True
    reading, entered, outcomes = 0, set(), []
    for room, match, readings in visits:
        claims.matched[0], judged = match, [NOTHING]
        pose = np.array((ROOMS[room], 2.0, 0.0))
        for _ in range(readings):
            is_new = room >= 0 and room not in entered
            judged.append(judge_claim(0, reading, 0.5 * reading, pose, room, is_new, claims))
            entered.add(room)
            reading += 1
        outcomes.append(max(judged))
        assert sum(outcome != NOTHING for outcome in judged) <= 1  # Only the first counts.
    return outcomes, claims.counts[0].tolist()


@pytest.mark.parametrize(
    ("visits", "outcomes", "counts"),
    [
        # In A reading 0 says nothing yet; B is not where reading 4 was taken; back in A, 2 was.
        ([(A, 0, 9), (B, 4, 9), (A, 2, 9)], [NOTHING, FALSE, RIGHT], [1, 1, 1]),
        # The mapper recognises nothing, or takes A for B.
        ([(A, 0, 9), (B, 9, 9), (A, NOWHERE, 9)], [NOTHING, NOTHING, FALSE], [1, 0, 1]),
        ([(A, 0, 9), (B, 9, 9), (A, 12, 9)], [NOTHING, NOTHING, FALSE], [1, 0, 1]),
        # It matches a reading of the present visit: true, and worth nothing.
        ([(A, 0, 9), (B, 9, 9), (A, 18, 9)], [NOTHING, NOTHING, NOTHING], [1, 0, 0]),
        # The same room once more is right once more, and that is worth nothing.
        (
            [(A, 0, 9), (B, 9, 9), (A, 2, 9), (B, 12, 9), (A, 20, 9)],
            [NOTHING, NOTHING, RIGHT, RIGHT, AGAIN],
            [3, 3, 0],
        ),
        # Out into the doorway and back is no return.
        ([(A, 0, 9), (BETWEEN, 2, 3), (A, 2, 9)], [NOTHING, NOTHING, NOTHING], [0, 0, 0]),
    ],
)
def test_claims_by_hand(
    two_rooms: World,
    visits: list[tuple[int, int, int]],
    outcomes: list[int],
    counts: list[int],
) -> None:
    assert _judged(two_rooms, *visits) == (outcomes, counts)


@pytest.mark.parametrize("matches", [True, False])
@given(
    visits=st.lists(
        st.tuples(st.sampled_from((A, B, BETWEEN)), st.integers(-1, 30), st.integers(1, 6)),
        min_size=1,
        max_size=8,
    )
)
def test_what_a_claim_would_be_is_what_the_first_of_the_visit_becomes(
    two_rooms: World, matches: bool, visits: list[tuple[int, int, int]]
) -> None:
    tables = []
    for is_claim in (True, False):  # One robot claims with every step, the other is only asked.
        table = with_room(no_claims(1, matches=matches), 60, 2)
        table.claims[:] = is_claim
        tables.append(table._replace(barriers=with_barriers(NO_BARRIERS, two_rooms)))
    (claiming, silent), reading = tables, 0
    entered: set[int] = set()
    became: dict[int, list[int]] = {}
    would: dict[int, list[int]] = {}
    for room, match, readings in visits:
        match = min(match, reading)  # Nothing later was read.
        claiming.matched[0] = match
        pose = np.array((ROOMS[room], 2.0, 0.0))
        for _ in range(readings):
            is_new, driven = room >= 0 and room not in entered, 0.5 * reading
            outcomes = [
                judge_claim(0, reading, driven, pose, room, is_new, each) for each in tables
            ]
            entered.add(room)
            visit = int(silent.visit[0])
            became.setdefault(visit, []).append(RIGHT if outcomes[0] == AGAIN else outcomes[0])
            asked = claim_outcome(0, driven, pose, room, match, silent)
            would.setdefault(visit, []).append(asked)
            reading += 1
    assert silent.counts[0, 1:].tolist() == [0, 0]  # Asking is not claiming.
    for visit, asked_then in would.items():
        first = next((outcome for outcome in asked_then if outcome != NOTHING), NOTHING)
        assert first == max(became[visit])


def test_a_batch_tells_what_claims_would_be_and_nothing_changes(two_rooms: World) -> None:
    """Without a mapper a claim is false in the first room, from one metre on."""
    told = []
    for asks in (True, False):
        batch: Any = gymnasium.make_vec(
            "Albot/Explore-v0", num_envs=2, world=two_rooms, mapper="none"
        ).unwrapped
        batch.reset(seed=1, options={"start": 0})
        for _ in range(40):
            ended = batch.step(np.tile(np.float32((0.6, 0.3, -1.0)), (2, 1)))
            if asks:
                settled = ended[4]["path_length"] >= SETTLED
                expected = np.where(settled, -1, 0)
                assert batch.claim_outcomes.tolist() == expected.tolist()
        told.append(ended[0])
        batch.close()
    assert (told[0] == told[1]).all()
    homing: Any = gymnasium.make_vec("Albot/Homing-v0", 1, world=two_rooms, mapper="none")
    homing.reset(seed=1)
    assert homing.unwrapped.claim_outcomes.tolist() in ([0], [-1])
    homing.close()


def test_without_recognition_a_claim_is_to_have_been_in_the_room(two_rooms: World) -> None:
    claims = with_room(no_claims(1, matches=False), 100, 2)
    claims.claims[:] = True
    pose = np.zeros(3)
    steps = [(A, True), *3 * [(A, False)], (B, True), *3 * [(B, False)], *4 * [(A, False)]]
    judged = [
        judge_claim(0, k, 0.5 * k, pose, room, new, claims) for k, (room, new) in enumerate(steps)
    ]
    assert judged == [*2 * [NOTHING], FALSE, *3 * [NOTHING], FALSE, *3 * [NOTHING], RIGHT, NOTHING]
    assert claims.points.shape[1] == 0


class _Mapper:
    """A mapper that matches what it is told to."""

    recognises_places = True

    def __init__(self) -> None:
        self.matched_readings = np.full(1, NOWHERE)

    def match_readings(self, rows: np.ndarray) -> None:
        """Nothing is ever out of date."""


@pytest.mark.parametrize(
    ("seen", "thought_again", "outcome"), [(2, NOWHERE, RIGHT), (NOWHERE, 2, FALSE), (6, 2, FALSE)]
)
def test_a_claim_is_of_the_match_that_the_agent_saw(
    two_rooms: World, seen: int, thought_again: int, outcome: int
) -> None:
    mapper = _Mapper()
    judge = ClaimJudge(1, mapper)
    judge.begin(0, two_rooms)
    steps = np.zeros(1, np.int64)
    for k in range(15):
        room, is_claim = (A, B, A)[k // 5], k == 14
        mapper.matched_readings[0] = seen
        judge.hear(np.full(1, is_claim), steps)
        mapper.matched_readings[0] = thought_again
        pose = np.array((ROOMS[room], 2.0, 0.0))
        judged = judge_claim(0, k, 0.5 * k, pose, room, k in (0, 5), judge.table)
        steps += 1
    assert judged == outcome


def test_there_is_room_for_ever_more_readings(two_rooms: World) -> None:
    """A longer journey than there was room for at first: earlier readings are kept."""
    visits = (A, 0, 400), (B, 0, 400), (A, 5, 400)
    assert _judged(two_rooms, *visits)[0] == [NOTHING, FALSE, RIGHT]
    claims = with_room(no_claims(2, matches=True), 1, 3)
    claims.points[1, 7] = 3.0
    wider = with_room(claims, claims.points.shape[1] + 1, 5)
    assert wider.points.shape[1] == 2 * claims.points.shape[1]
    assert wider.recognized.shape == (2, 5)
    assert (wider.points[1, 7] == 3.0).all()


def test_a_mapper_with_narrow_places_earns_what_it_recognises(two_rooms: World) -> None:
    """Correct places half a metre wide and an ideal odometer: no claim is false."""
    mapper = "tests.core.mappers.topological:topological"
    env = ExploreEnv(two_rooms, mapper=mapper, odometer="ideal")
    env.reset(seed=1, options={"start": 0})
    for x in (7.0, 2.0, 7.0, 2.0):
        info = _drive_to(env, x, recognised=True)[-1]
    assert info["re_entries"] == 3
    assert info["right_claims"] == 3
    assert info["false_claims"] == 0


def _drive_to(
    env: ExploreEnv, x: float, claim: float = -1.0, *, recognised: bool = False
) -> list[dict[str, Any]]:
    """Straight on along the rooms, forwards or back, until there; the infos.

    It claims all the time, or whenever the mapper recognises its place.
    """
    infos = []
    while True:
        ahead = x - env._robot.poses[0, 0]
        if abs(ahead) < 0.2:
            return infos
        if recognised:
            claim = 1.0 if env._robot.matched_reading(0) >= 0 else -1.0
        infos.append(env.step(np.array((0.8 * np.sign(ahead), 0, claim), np.float32))[4])


@pytest.mark.parametrize("mapper", ["none", "odometry"])
def test_a_right_claim_is_worth_something_and_a_false_one_costs(
    two_rooms: World, mapper: str
) -> None:
    env = ExploreEnv(two_rooms, mapper=mapper, config=ExploreConfig())
    assert env.action_space.shape == (3,)
    _, info = env.reset(seed=1, options={"start": 0})
    assert (info["re_entries"], info["right_claims"], info["false_claims"]) == (0, 0, 0)
    for x, claim, counts, worth in (
        (7.0, -1.0, (0, 0, 0), 0.0),  # Silent.
        (6.5, 1.0, (0, 0, 1), -2.0),  # The east is new.
        (3.0, -1.0, (1, 0, 1), 0.0),
        (2.0, 1.0, (1, 1, 1), 1.0),  # The west is not.
        (7.0, 1.0, (2, 2, 1), 1.0),
        (3.0, 1.0, (3, 3, 1), 0.0),  # The west was recognised before.
    ):
        infos = _drive_to(env, x, claim)
        info = infos[-1]
        assert (info["re_entries"], info["right_claims"], info["false_claims"]) == counts
        terms = [each["reward_terms"] for each in infos]
        earned = sum(term["place_recognized"] + term["place_mistaken"] for term in terms)
        assert earned == worth


def test_without_claims_nothing_is_claimed(two_rooms: World) -> None:
    env = ExploreEnv(two_rooms, mapper="none", config=ExploreConfig(claims=False))
    assert env.action_space.shape == (2,)
    env.reset(seed=1, options={"start": 0})
    info = env.step(np.array((1, 1), np.float32))[4]
    assert info["false_claims"] == info["reward_terms"]["place_mistaken"] == 0


def test_what_was_seen_on_the_way_out_can_be_recognised_on_the_way_home(two_rooms: World) -> None:
    """Correct places and an ideal odometer: the room that the robot left on its way out."""
    outing = OutwardJourneyConfig(shortest=9.0, longest=9.0, away=3.0)
    mapper = "tests.core.mappers.topological:topological"
    config = HomingConfig(outing=outing, claims=True)
    for seed in range(20):
        env = HomingEnv(two_rooms, mapper=mapper, odometer="ideal", config=config)
        _, info = env.reset(seed=seed, options={"start": 0})
        if info["room"] != "east":
            continue
        assert env.action_space.shape == (4,)
        earned = 0.0
        for goal in ((6.0, 2.0), (4.0, 2.0), (2.0, 2.0)):
            while math.dist(goal, info["pose"][:2]) > 0.3:
                x, y, heading = info["pose"]
                turn = math.remainder(math.atan2(goal[1] - y, goal[0] - x) - heading, 2 * math.pi)
                speed = 0.6 * max(0.0, math.cos(turn)) ** 4
                claim = 1.0 if env._robot.matched_reading(0) >= 0 else -1.0
                action = np.array((speed, np.clip(turn, -0.5, 0.5), -1.0, claim), np.float32)
                info = env.step(action)[4]
                earned += info["reward_terms"]["place_recognized"]
        assert earned == 1.0
        assert (info["re_entries"], info["right_claims"], info["false_claims"]) == (1, 1, 0)
        assert not info["declared"]
        state = env.get_state()
        later = env.step(np.array((1.0, 0.0, -1.0, 1.0), np.float32))
        env.set_state(state)
        again = env.step(np.array((1.0, 0.0, -1.0, 1.0), np.float32))
        assert later[1] == again[1]
        return
    pytest.fail("no journey led to the other room")


def test_a_visit_that_began_on_the_way_out_counts_as_the_re_entry_that_it_was() -> None:
    """So no robot rightly claims more visits than there were."""
    outing = OutwardJourneyConfig(shortest=25.0, longest=25.0, away=0.0)
    env = HomingEnv(LOOP, mapper="none", config=HomingConfig(outing=outing, claims=True))
    began = set()
    for seed in range(4):
        _, info = env.reset(seed=seed)
        began.add(info["re_entries"])
        first = info["re_entries"], info["room"]
        for _ in range(40):
            info = env.step(np.array((0.7, 0.8, -1.0, 1.0), np.float32))[4]
            assert info["right_claims"] <= info["re_entries"]
        if first[0] and info["room"] == first[1]:
            assert info["right_claims"] == 1
    assert began == {0, 1}
