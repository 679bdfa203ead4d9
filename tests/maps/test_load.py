"""World specs: a catalogue name first, then a file."""

from __future__ import annotations

import gc
import gzip
import lzma
import weakref
from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, WorldSet, catalogue_names, load_world, load_worlds
from albot_maps import load as module
from albot_maps.formats.world_file import world_text


@pytest.mark.parametrize(
    ("suffix", "pack"), [("", bytes), (".gz", gzip.compress), (".xz", lzma.compress)]
)
def test_a_file_may_be_compressed(tmp_path, suffix, pack):
    world = load_world("office-ring")
    path = tmp_path / f"ring.yaml{suffix}"
    path.write_bytes(pack(world_text(world).encode()))
    loaded = load_world(str(path))
    assert np.array_equal(loaded.walls, world.walls)
    assert loaded.source == str(path)


def test_a_name_of_the_catalogue_comes_before_a_folder_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "square-loop").mkdir()
    assert load_world("square-loop").source == "square-loop"
    with pytest.raises(InputError, match="a world file"):
        load_world("./square-loop")


def test_the_names_are_the_files_that_are_shipped():
    folder = Path(__file__).parents[2] / "maps" / "albot_maps" / "catalogue"
    assert catalogue_names() == tuple(sorted(path.stem for path in folder.glob("*.yaml")))


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(InputError) as caught:
        load_world("squareloop")
    for name in catalogue_names():
        assert name in str(caught.value)
    assert str(caught.value).endswith("found squareloop (did you mean square-loop?)")


def test_a_range_of_seeds_names_as_many_worlds() -> None:
    worlds = load_worlds("random:ring:3..5?loops=2")
    assert len(worlds) == 3
    for number, seed in enumerate((3, 4, 5)):
        alone = load_world(f"random:ring:{seed}?loops=2")
        np.testing.assert_array_equal(worlds[number].walls, alone.walls)
        assert worlds[number].source == alone.source


@pytest.mark.parametrize("spec", ["square-loop", "random:ring:7"])
def test_any_other_spec_names_one_world(spec: str) -> None:
    worlds = load_worlds(spec)
    assert len(worlds) == 1
    assert worlds[0].name == load_world(spec).name


def test_a_folder_is_no_world(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a world file: .yaml, .*, found a folder"):
        load_world(str(tmp_path))
    (tmp_path / "a.yaml").mkdir()
    with pytest.raises(InputError, match="expected a file, found a folder"):
        load_world(str(tmp_path / "a.yaml"))


def test_a_world_is_made_once_and_only_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def load(spec: str, robot_radius: float) -> object:
        assert robot_radius == ROBOT_RADIUS
        made.append(spec)
        return load_world("square-loop")

    monkeypatch.setattr(module, "load_world", load)
    worlds = WorldSet([f"world {k}" for k in range(5)])
    assert made == ["world 0"]
    assert worlds[3] is worlds[3]
    assert made == ["world 0", "world 3"]


def test_worlds_not_needed_for_long_are_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "KEPT", 2)
    monkeypatch.setattr(module, "_RANDOM", weakref.WeakValueDictionary())  # Others may keep theirs.
    worlds = load_worlds("random:ring:0..3")
    first, walls = weakref.ref(worlds[0]), worlds[0].walls
    assert worlds[1] is worlds[1]
    worlds[2]
    gc.collect()
    assert first() is None
    np.testing.assert_array_equal(worlds[0].walls, walls)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("random:office:5..3", "a range of seeds A..B"),
        ("random:castle:0..3", "one of the kinds"),
        ("random:office:0..3?romms=2", "did you mean rooms"),
        (f"random:ring:0..{2**64}", "a whole number from 0"),
        ("random:office:0..", "a whole number from 0"),
    ],
)
def test_a_spec_that_is_none_is_told_at_once(spec: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_worlds(spec)


def test_numbers_beyond_the_set_are_refused() -> None:
    worlds = load_worlds("random:ring:0..3")
    for number in (-1, 4):
        with pytest.raises(InputError, match=r"a world's number below 4"):
            worlds[number]
    with pytest.raises(InputError, match="at least one world"):
        WorldSet(())


def test_worlds_come_in_turn() -> None:
    worlds = load_worlds("random:maze:3..5")
    assert [world.name for world in worlds] == ["maze-3", "maze-4", "maze-5"]


def test_a_random_world_in_use_is_made_once(monkeypatch):
    monkeypatch.setattr(module, "_RANDOM", weakref.WeakValueDictionary())  # Others may keep theirs.
    first = load_world("random:office:3")
    assert load_world("random:office:3") is first
    assert load_worlds("random:office:2..3")[1] is first  # So what is cached for it is shared.
    assert load_world("random:office:3", 0.2) is not first
    walls = first.walls.copy()
    del first
    gc.collect()
    assert not module._RANDOM  # Nobody keeps it.
    np.testing.assert_array_equal(load_world("random:office:3").walls, walls)


def test_a_list_of_specs_names_a_world_each() -> None:
    worlds = load_worlds(["square-loop", "office-ring"])
    assert [world.name for world in worlds] == ["square-loop", "office-ring"]
    with pytest.raises(InputError, match="at least one world"):
        load_worlds([])
    with pytest.raises(InputError, match="nowhere"):
        load_worlds(["nowhere"])
