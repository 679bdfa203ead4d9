"""Minari data sets, loaded by Minari."""

from __future__ import annotations

from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.export.minari_dataset import DatasetPlace, check_place, new_minari_dataset
from albot_env.export.replay import replay
from albot_env.export.transitions import Transitions
from albot_env.recording.reader import EpisodeReader
from tests.env import quick
from tests.env.export.conftest import Recorded, check_same

pytest.importorskip("minari", reason="minari is not installed: pip install '.[minari]'")
pytest.importorskip("h5py", reason="h5py is not installed: pip install '.[minari]'")

import minari

Record = Callable[..., Recorded]
EXPLORE = "Albot/Explore-v0"


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "minari"
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    return folder


def _transitions(path: Path) -> Transitions:
    return replay(EpisodeReader(path), path.name)


def _check_environment(dataset: Any) -> None:
    """The environment that Minari makes again gives each episode again."""
    env = dataset.recover_environment()
    about = list(dataset.storage.get_episode_metadata(dataset.episode_indices))
    for episode, known in zip(dataset, about, strict=True):
        observation, _ = env.reset(seed=known["seed"], options=known.get("options"))
        for step, action in enumerate(episode.actions):
            seen = episode.observations
            if isinstance(seen, dict):
                assert all(np.array_equal(observation[name], seen[name][step]) for name in seen)
            else:
                assert np.array_equal(observation, seen[step])
            observation, reward, terminated, _, _ = env.step(action)
            assert reward == episode.rewards[step]
            assert terminated == episode.terminations[step]
    env.close()


@pytest.mark.parametrize(
    ("task", "settings"),
    [
        (EXPLORE, {"mapper": "odometry", "observation": "dict"}),
        ("Albot/Homing-v0", {"config": quick.STROLL, "action": "discrete"}),
        ("Albot/PlaceRecognition-v0", {"config": quick.GLANCE, "journeys": 4}),
    ],
)
def test_minari_loads_what_was_recorded(
    task: str, settings: Any, record: Record, root: Path
) -> None:
    place = DatasetPlace.of("albot/test-v3")
    was = []
    with new_minari_dataset(place) as dataset:
        for seed in (3, 4):
            path, episode = record(task, f"{seed}.mcap", seed, **settings)
            was.append(episode)
            dataset.add(_transitions(path), path.name)
    loaded = minari.load_dataset("albot/test-v3")
    assert (dataset.episodes, dataset.steps) == (loaded.total_episodes, loaded.total_steps)
    assert (loaded.observation_space, loaded.action_space) == was[0]["spaces"]
    for found, episode in zip(loaded, was, strict=True):
        check_same(found, episode)
    about = list(loaded.storage.get_episode_metadata([0, 1]))
    assert [(each["seed"], each["agent"], each["world"]) for each in about] == [
        (3, "chance", "square-loop"),
        (4, "chance", "square-loop"),
    ]
    assert loaded.env_spec.max_episode_steps == loaded.recover_environment().spec.max_episode_steps
    _check_environment(loaded)


def test_episodes_in_several_worlds(record: Record, root: Path) -> None:
    place = DatasetPlace.of("worlds-v0")
    worlds = ("square-loop", "office-ring", "square-loop")
    with new_minari_dataset(place) as dataset:
        for seed, world in enumerate(worlds):
            path, _ = record(EXPLORE, f"{seed}.mcap", seed, world=world, mapper="none")
            dataset.add(_transitions(path), path.name)
    loaded = minari.load_dataset("worlds-v0")
    assert loaded.env_spec.kwargs["world"] == ["square-loop", "office-ring"]
    about = list(loaded.storage.get_episode_metadata([0, 1, 2]))
    assert [each["options"]["world"] for each in about] == [0, 1, 0]
    _check_environment(loaded)


def test_a_seed_that_draws_the_world(record: Record, root: Path) -> None:
    settings = {"world": "random:office:0..3?rooms=2", "mapper": "none"}
    first, _ = record(EXPLORE, "1.mcap", 2**80, **settings)
    with new_minari_dataset(DatasetPlace.of("drawn-v0")) as dataset:
        dataset.add(_transitions(first), first.name)
    loaded = minari.load_dataset("drawn-v0")
    (about,) = loaded.storage.get_episode_metadata([0])
    assert about["seed"] == 2**80
    assert "options" not in about
    _check_environment(loaded)
    other, _ = record(EXPLORE, "2.mcap", mapper="none")
    with (
        pytest.raises(InputError, match=r"2\.mcap, spec\.kwargs\.world"),
        new_minari_dataset(DatasetPlace.of("mixed-v0")) as dataset,
    ):
        dataset.add(_transitions(first), first.name)
        dataset.add(_transitions(other), other.name)
    assert not (root / "mixed-v0").exists()


@pytest.mark.parametrize(
    ("task", "settings", "words"),
    [
        ("Albot/ExploreAndHome-v1", {}, ("an episode of Albot/Explore-v0", "ExploreAndHome")),
        (EXPLORE, {"odometer": "poor"}, ("odometer", "poor")),
        (EXPLORE, {"action": "discrete"}, ("action", "discrete")),
    ],
)
def test_another_environment_is_one_clear_error(
    task: str, settings: Any, words: tuple[str, ...], record: Record, tmp_path: Path
) -> None:
    first, _ = record(EXPLORE, "1.mcap", mapper="none")
    other, _ = record(task, "2.mcap", mapper="none", **settings)
    place = DatasetPlace.of(str(tmp_path / "new"))
    with pytest.raises(InputError) as error, new_minari_dataset(place) as dataset:
        dataset.add(_transitions(first), first.name)
        dataset.add(_transitions(other), other.name)
    for word in ("2.mcap", *words):
        assert word in str(error.value)
    assert not place.folder.exists()


def test_a_folder_and_its_replacement(record: Record, tmp_path: Path, root: Path) -> None:
    path, was = record(EXPLORE, mapper="none")
    place = DatasetPlace.of(str(tmp_path / "my episodes"))
    assert (place.id, place.load) == ("my-episodes-v0", str(tmp_path / "my episodes"))
    episode = _transitions(path)
    for force in (False, True):
        with new_minari_dataset(place, force=force) as dataset:
            dataset.add(episode, path.name)
        check_same(minari.load_dataset(place.load)[0], was)
    with pytest.raises(InputError, match="--force"):
        check_place(place)
    assert {found.name for found in place.folder.iterdir()} == {"data"}
    (place.folder / "thesis.tex").write_text("x")
    with pytest.raises(InputError, match=r"thesis\.tex"):
        check_place(place, force=True)


def test_no_episode_and_an_error_leave_nothing(tmp_path: Path) -> None:
    place = DatasetPlace.of(str(tmp_path / "a" / "new"))
    with new_minari_dataset(place):
        pass
    with pytest.raises(ZeroDivisionError), new_minari_dataset(place) as dataset:
        assert not dataset.episodes
        raise ZeroDivisionError
    assert [*tmp_path.iterdir()] == []


def test_ids_and_folders_are_told_apart(root: Path) -> None:
    assert DatasetPlace.of("a/b-c/d-v12").folder == root / "a" / "b-c" / "d-v12"
    for text in ("./d-v1", "d", "/d-v1", "../d-v0", "a//d-v1", "d-v"):
        place = DatasetPlace.of(text)
        assert place.folder == Path(text).resolve()
        assert place.load == str(place.folder)


def test_a_missing_library_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = util.find_spec
    monkeypatch.setattr(
        "albot_env.export.minari_dataset.find_spec",
        lambda name: None if name == "h5py" else known(name),
    )
    with pytest.raises(InputError, match=r"pip install 'albot-env\[minari\]'.*package h5py"):
        check_place(DatasetPlace.of(str(tmp_path / "new")))
