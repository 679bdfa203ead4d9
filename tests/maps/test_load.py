"""World specs: a catalogue name first, then a file."""

from __future__ import annotations

import gzip
import lzma
from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_maps import catalogue_names, load_world
from albot_maps.formats.world_text import world_text


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
