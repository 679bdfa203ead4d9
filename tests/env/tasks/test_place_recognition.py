"""What judging places is worth, what is observed of them, and where tours lead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.mapper import Estimate
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.slam.scan_matching import ScanMatching
from albot_core.sensing.reading import Reading
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core import journeys
from albot_env.tasks.place_recognition import tours
from albot_env.tasks.place_recognition.arrivals import PlaceDatabase
from albot_env.tasks.place_recognition.env import PlaceRecognitionEnv
from albot_env.tasks.place_recognition.reward import PlaceRecognitionWeights
from albot_env.tasks.place_recognition.spaces import FEATURES
from albot_env.tasks.place_recognition.task import PlaceRecognitionConfig
from albot_env.tasks.place_recognition.tours import StoppingRooms, TourConfig
from albot_maps import Exit, World, load_world
from albot_maps.generators.spec import KINDS
from tests.env.quick import JUDGED

THERE_AND_BACK = PlaceRecognitionConfig(tour=TourConfig(rooms=("east", "west", "east")))
"""From the west: new, known, known."""


def _make(world: str | World, **options: Any) -> PlaceRecognitionEnv:
    return PlaceRecognitionEnv(world, **{"mapper": "none", "journeys": 1, **options})


def _answer(env: PlaceRecognitionEnv, *answers: int) -> list[tuple[Any, ...]]:
    """Begin in the west, give the answers; every step."""
    env.reset(seed=1, options={"start": 0})
    return [env.step(answer) for answer in answers]


def _terms(step: tuple[Any, ...]) -> dict[str, float]:
    return {name: worth for name, worth in step[4]["reward_terms"].items() if worth}


def test_a_mapper_that_believes_to_be_nowhere_is_named(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimate = Estimate(pose=np.full(3, np.nan), home=np.zeros(3))
    monkeypatch.setattr(ScanMatching, "estimate", property(lambda _: estimate))
    env = _make(two_rooms, config=THERE_AND_BACK, mapper="scan-matching")
    with pytest.raises(
        InputError, match=r"^mapper scan-matching, reading \d+, estimate\.pose: .*nan"
    ):
        env.reset(seed=1)


def test_who_knows_all_again_succeeds(two_rooms: World) -> None:
    steps = _answer(_make(two_rooms, config=THERE_AND_BACK), 0, 1, 2)
    assert [_terms(step) for step in steps] == [
        {"right_new": 0.5}, {"right_known": 1.0}, {"right_known": 1.0},
    ]  # fmt: skip
    assert [step[2:4] for step in steps] == [(False, False), (False, False), (True, False)]
    info = steps[-1][4]
    assert (info["is_success"], info["precision"], info["recall"]) == (True, 1.0, 1.0)
    assert (info["right_known"], info["right_new"], info["revisits"]) == (2, 1, 2)
    assert not any(step[4]["is_success"] for step in steps[:-1])


def test_who_takes_all_for_new_is_never_wrong_and_knows_nothing(two_rooms: World) -> None:
    steps = _answer(_make(two_rooms, config=THERE_AND_BACK), 0, 0, 0)
    assert [_terms(step) for step in steps][1:] == [{"missed": -1.0}, {"missed": -1.0}]
    info = steps[-1][4]
    assert (info["precision"], info["recall"], info["is_success"]) == (1.0, 0.0, False)
    assert info["missed"] == info["revisits"] == 2


@pytest.mark.parametrize(
    ("answers", "false"),
    [
        ((1,), [True]),  # The east is not the west.
        ((3,), [True]),  # There is no third arrival yet.
        ((2,), [True]),  # This is the second one: not an earlier one.
        ((0, 2, 1), [False, True, True]),  # Known places, but others.
        ((0, 1, 3), [False, False, True]),
    ],
)
def test_a_wrong_arrival_is_a_false_alarm(
    two_rooms: World, answers: tuple[int, ...], false: list[bool]
) -> None:
    steps = _answer(_make(two_rooms, config=THERE_AND_BACK), *answers)
    assert [_terms(step) == {"false_known": -5.0} for step in steps] == false
    info = steps[-1][4]
    assert info["false_known"] == sum(false)
    assert info["precision"] < 1
    assert not info["is_success"]


def test_any_arrival_in_the_same_room_will_do(two_rooms: World) -> None:
    rooms = ("east", "west", "east", "west", "east")
    env = _make(two_rooms, config=PlaceRecognitionConfig(tour=TourConfig(rooms=rooms)))
    for answer in (2, 4):
        assert _terms(_answer(env, 0, 0, 0, 0, answer)[-1]) == {"right_known": 1.0}
    assert _answer(env, 0, 0, 0, 0)[-1][4]["right_answer"] == 4


def test_a_recall_below_what_is_wanted_is_no_success(two_rooms: World) -> None:
    for recall, success in ((0.5, True), (0.6, False)):
        config = PlaceRecognitionConfig(tour=THERE_AND_BACK.tour, recall=recall)
        info = _answer(_make(two_rooms, config=config), 0, 0, 2)[-1][4]
        assert (info["recall"], info["is_success"]) == (0.5, success)


def test_a_time_limit_truncates(two_rooms: World) -> None:
    settings = {"mapper": "none", "journeys": 1, "config": THERE_AND_BACK}
    env = gymnasium.make(JUDGED[0], world=two_rooms, max_episode_steps=2, **settings)
    env.reset(seed=1, options={"start": 0})
    assert [env.step(0)[2:4] for _ in range(2)] == [(False, False), (False, True)]


def test_weights_scale_their_terms(two_rooms: World) -> None:
    weights = PlaceRecognitionWeights(missed=-0.25, false_known=-9.0)
    config = PlaceRecognitionConfig(tour=THERE_AND_BACK.tour, weights=weights)
    steps = _answer(_make(two_rooms, config=config), 3, 0)
    assert [step[1] for step in steps] == [-9.0, -0.25]


def test_the_mask_says_which_arrivals_there_are(two_rooms: World) -> None:
    env = _make(two_rooms, config=THERE_AND_BACK, observation="dict")
    seen = [env.reset(seed=1)[0], *(step[0] for step in _answer(env, 0, 0, 0))]
    assert [(parts["mask"] > 0).sum() for parts in seen] == [1, 2, 3, 0]
    for parts in seen:
        assert parts["arrivals"].shape == (3, len(FEATURES))
        assert not parts["arrivals"][parts["mask"] < 0].any()
        assert parts in env.observation_space


def test_what_can_be_answered_is_that_it_is_new_and_what_the_mask_shows(two_rooms: World) -> None:
    env = _make(two_rooms, config=THERE_AND_BACK, observation="dict")
    observation, _ = env.reset(seed=1)
    for _ in range(3):
        assert env.action_masks().tolist() == [True, *(observation["mask"] > 0)]
        observation = env.step(0)[0]


@pytest.mark.parametrize("mapper", ["none", "albot1"])
def test_the_same_room_looks_the_same_and_the_other_does_not(two_rooms: World, mapper: str) -> None:
    config = PlaceRecognitionConfig(tour=TourConfig(rooms=("east", "west", "east", "west")))
    env = _make(two_rooms, mapper=mapper, config=config, observation="dict")
    steps = _answer(env, 0, 0, 0)
    for here, (observation, *_) in enumerate(steps, start=2):
        rows = [dict(zip(FEATURES, row, strict=True)) for row in observation["arrivals"][:here]]
        same = [k % 2 == here % 2 for k in range(here)]
        # The rooms are alike: laid on the other one, the panorama lies off where it should.
        fits = np.array([row["agreed"] + row["sight"] - row["shift"] for row in rows])
        assert fits[same].min() > fits[np.logical_not(same)].max() + 0.3
        assert min(row["agreed"] for row, alike in zip(rows, same, strict=True) if alike) > 0.6
        assert min(row["sight"] for row, alike in zip(rows, same, strict=True) if alike) > 0
        places = {row["place"] for row, alike in zip(rows, same, strict=True) if alike}
        assert places == ({0.0} if mapper == "none" else {1.0})


def test_observations_are_a_function_of_the_readings_alone(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recorded readings, replayed to a fresh places without any world, give the same ones."""
    recorded: list[tuple[str, Any]] = []

    class Recorded(PlaceDatabase):
        def follow(self, reading: Reading) -> None:
            recorded.append(("follow", reading))
            super().follow(reading)

        def arrive(self, readings: Sequence[Reading]) -> Any:
            before = len(recorded)
            found = super().arrive(readings)
            recorded[before:] = [("arrive", tuple(readings))]
            return found

    monkeypatch.setattr(tours, "PlaceDatabase", Recorded)
    config = PlaceRecognitionConfig(tour=TourConfig(rooms=("east", "west")))
    env = _make(two_rooms, mapper="albot1", config=config, observation="dict")
    journeys.JOURNEY_CACHE.clear()  # It is made before our eyes.
    seen = [env.reset(seed=1)[0], env.step(0)[0]]
    places, again = PlaceDatabase(make_mapper("albot1")), []
    for act, what in recorded:
        found = getattr(places, act)(what)
        again += [] if found is None else [found]
    assert len(again) == 3
    for observation, rows in zip(seen, again[1:], strict=True):
        assert observation["arrivals"][: len(rows)].tobytes() == rows.tobytes()


def test_kept_tours_are_those_that_would_be_made(two_rooms: World) -> None:
    one, other = (_make(two_rooms, journeys=2, config=THERE_AND_BACK) for _ in range(2))
    start = {"start": 0}
    seen = [one.reset(seed=seed, options=start) for seed in range(4)]
    journeys.JOURNEY_CACHE.clear()
    other.reset(seed=11, options=start)
    other.step(1)
    for seed, (observation, info) in enumerate(seen):
        again, twin = other.reset(seed=seed, options=start)
        assert observation.tobytes() == again.tobytes()
        assert np.array_equal(info["pose"], twin["pose"])
    assert len({info["pose"].tobytes() for _, info in seen}) == 2


def test_new_tours_are_all_different(two_rooms: World) -> None:
    env = _make(two_rooms, journeys=0, config=THERE_AND_BACK)
    assert len({env.reset(seed=seed)[1]["pose"].tobytes() for seed in range(2)}) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_there_are_tours_through_every_kind_of_world(kind: str) -> None:
    config = PlaceRecognitionConfig(tour=TourConfig(arrivals=4, revisits=1.0))
    env = _make(f"random:{kind}:1", config=config)
    _, info = env.reset(seed=2)
    for _ in range(3):
        assert info["room"]
        assert not info["collided"]
        info = env.step(info["right_answer"])[4]
    assert info["is_success"]


def test_half_of_the_stops_are_in_known_rooms() -> None:
    stops, shares = StoppingRooms(load_world("random:office:3")), []
    for seed in range(40):
        rooms = [0, *stops.drawn(0, TourConfig(), np.random.default_rng(seed))]
        known = [room in rooms[:k] for k, room in enumerate(rooms)]
        assert known[:3] == [False] * 3
        assert all(a != b for a, b in pairwise(rooms))
        shares.append(np.mean(known[3:]))
    assert np.mean(shares) == pytest.approx(0.5, abs=0.05)


def test_a_tour_may_set_out_where_it_can_not_stop() -> None:
    """Between rooms, or in one that is too small: the first stop then is in any other."""
    stops = StoppingRooms(load_world("office-ring"))
    rooms = list(stops.drawn(-1, TourConfig(arrivals=6, revisits=1.0), np.random.default_rng(1)))
    assert len(rooms) == 5
    assert -1 not in rooms
    assert len(set(rooms)) == 3


def test_stops_are_in_their_rooms_and_clear_of_walls() -> None:
    world, rng = load_world("office-ring"), np.random.default_rng(1)
    stops = StoppingRooms(world)
    for room in stops.named(("P1", "P3")):
        for _ in range(20):
            x, y = stops.point(room, rng)
            assert world.room_at(x, y) == world.rooms[room].name
            assert world.free_space.region_at(np.array((x, y)))


@pytest.mark.parametrize(("width", "same"), [(None, False), (1.0, False), (4.0, True)])
def test_rooms_without_a_doorway_between_them_are_one_place(
    two_rooms: World, width: float | None, same: bool
) -> None:
    """A doorway parts two places; as wide an opening as the rooms themselves does not."""
    walls = two_rooms.walls[:4] if width == 4.0 else two_rooms.walls
    exits: tuple[Exit, ...] = ()
    if width is not None:
        middle = np.array((5.0, 2 - width / 2, 5.0, 2 + width / 2))
        exits = (Exit(name="between", segment=middle, rooms=("west", "east")),)
    world = replace(two_rooms, walls=walls, exits=exits, glass=np.zeros(len(walls), np.bool_))
    env = _make(world, config=THERE_AND_BACK)
    info = env.reset(seed=1, options={"start": 0})[1]
    assert info["right_answer"] == (1 if same else 0)
    tour = env._robot._current_tours[0]
    assert tour is not None
    assert tour.same.tolist() == [[same or k % 2 == j % 2 for j in range(4)] for k in range(4)]


def test_a_tour_can_be_recorded(two_rooms: World, tmp_path: Any) -> None:
    env = _make(two_rooms, mapper="odometry", config=THERE_AND_BACK)
    env.agent, env.recorder = "judge", EpisodeWriter(tmp_path / "tour.mcap")
    _answer(env, 0, 1, 2)
    env.close()
    moments = list(EpisodeReader(tmp_path / "tour.mcap").moments())
    actions = [None if m.action is None else m.action.tolist() for m in moments]
    assert actions == [None, [0], [1], [2]]


@pytest.mark.parametrize("answer", [-1, 4, 0.5, np.array([0]), "new", None, np.nan])
def test_an_answer_that_is_none_is_refused(two_rooms: World, answer: Any) -> None:
    env = _make(two_rooms, config=THERE_AND_BACK)
    env.reset(seed=1)
    with pytest.raises(InputError, match="action: expected a whole number from 0 to 3"):
        env.step(answer)


def test_a_world_without_two_rooms_is_refused() -> None:
    cell = np.array([[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]], float)
    world = World(name="cell", walls=cell, starts=np.array(((2.0, 2.0, 0.0),)))
    with pytest.raises(InputError, match="two rooms in which a robot can stop"):
        _make(world).reset(seed=1)


@pytest.mark.parametrize(
    ("wrong", "found"),
    [
        (lambda: TourConfig(arrivals=1), "arrivals"),
        (lambda: TourConfig(revisits=1.5), "revisits"),
        (lambda: PlaceRecognitionConfig(recall=-0.1), "recall"),
        (lambda: PlaceRecognitionWeights(missed=float("inf")), "missed"),
        (lambda: _make("office-ring", journeys=-1), "journeys"),
        (
            lambda: _make(
                "office-ring", config=PlaceRecognitionConfig(tour=TourConfig(rooms=("P9",)))
            ).reset(seed=1),
            "P9",
        ),
    ],
)
def test_settings_that_are_none_are_refused(wrong: Any, found: str) -> None:
    with pytest.raises(InputError, match=found):
        wrong()
