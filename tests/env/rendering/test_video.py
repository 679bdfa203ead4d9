"""Videos and mosaics, read back by the libraries that others read them with."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from albot_core.errors import InputError
from albot_env.rendering import video as module
from albot_env.rendering.canvas import PALETTE, PANEL, paint_array, png_bytes
from albot_env.rendering.mosaic import NARROWEST, WIDEST, Tile, paint_mosaic, tile_size
from albot_env.rendering.scene import lay_out
from albot_env.rendering.video import open_video
from tests.env.rendering.test_rendering import made_frame


def read_mp4(path: Path) -> tuple[list[np.ndarray], float]:
    """Pictures of an MP4, and how many are shown in a second."""
    with av.open(str(path)) as container:
        (stream,) = container.streams.video
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate is not None
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        return pictures, float(stream.average_rate)


def plain(colour: tuple[int, int, int], size: tuple[int, int] = (64, 48)) -> np.ndarray:
    return np.full((size[1], size[0], 3), colour, np.uint8)


@pytest.mark.parametrize("size", [(64, 48), (65, 47), (64, 47)])
def test_an_mp4_has_the_pictures_in_their_order(tmp_path: Path, size: tuple[int, int]) -> None:
    colours = ((200, 30, 30), (30, 200, 30), (30, 30, 200))
    with open_video(tmp_path / "a.MP4") as video:
        for k, colour in enumerate(colours):
            video.add(plain(colour, size), k + 1)
        assert video.count == 6
    pictures, rate = read_mp4(tmp_path / "a.MP4")
    assert (len(pictures), rate) == (6, video.rate)
    width, height = size
    for picture, k in zip(pictures, (0, 1, 1, 2, 2, 2), strict=True):
        assert picture.shape == (height + height % 2, width + width % 2, 3)
        assert np.abs(picture.astype(int) - colours[k]).max() < 12


def test_a_gif_has_the_colours_and_times(tmp_path: Path) -> None:
    pictures = [plain(PALETTE[name]) for name in ("wall", "path", "home")]
    with open_video(tmp_path / "a.gif") as video:
        for picture in pictures:
            video.add(picture, 2)
    with Image.open(tmp_path / "a.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["loop"]) == (6, (64, 48), 0)
        for k in range(6):
            gif.seek(k)
            assert gif.info["duration"] == 1000 / video.rate
            seen = np.asarray(gif.convert("RGB")).astype(int)
            assert np.abs(seen - pictures[k // 2]).max() <= 4


def test_a_painted_picture_is_known_again_in_both(tmp_path: Path) -> None:
    picture = paint_array(lay_out(made_frame()))
    for name in ("a.gif", "a.mp4"):
        with open_video(tmp_path / name) as video:
            video.add(picture)
    with Image.open(tmp_path / "a.gif") as gif:
        away = np.abs(np.asarray(gif.convert("RGB")).astype(int) - picture)
    assert away.mean() < 0.2
    assert away.max() < 60
    (seen,), _ = read_mp4(tmp_path / "a.mp4")
    assert np.abs(seen.astype(int) - picture).mean() < 4


def test_the_same_pictures_give_the_same_file(tmp_path: Path) -> None:
    for name in ("a.mp4", "b.mp4", "a.gif", "b.gif"):
        with open_video(tmp_path / name) as video:
            video.add(paint_array(lay_out(made_frame()), (320, 240)), 3)
    for suffix in ("mp4", "gif"):
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("name", ["a.mp4", "a.gif"])
def test_what_is_broken_off_leaves_the_old_file(
    tmp_path: Path, error: type[BaseException], name: str
) -> None:
    (tmp_path / name).write_text("old")
    with pytest.raises(error), open_video(tmp_path / name) as video:
        video.add(plain((1, 2, 3)), 30)
        raise error
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "old"


def test_a_picture_of_another_size_is_an_error(tmp_path: Path) -> None:
    with (
        pytest.raises(ValueError, match=r"\(32, 48\) pixels in a video of \(64, 48\)"),
        open_video(tmp_path / "a.mp4") as video,
    ):
        video.add(plain((1, 2, 3)))
        video.add(plain((1, 2, 3), (32, 48)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.avi", "a", "mp4", "a.mp4.txt"])
def test_another_ending_is_an_error(tmp_path: Path, name: str) -> None:
    with (
        pytest.raises(InputError, match=r"expected a name that ends in \.mp4 or \.gif"),
        open_video(tmp_path / name),
    ):
        pass


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(InputError) as error, open_video(tmp_path / "a.gif"):
        pass
    assert "pip install 'albot-env[video]'" in str(error.value)
    assert importlib.util.find_spec("av") is not None
    assert not list(tmp_path.iterdir())


def test_each_tile_of_a_mosaic_is_where_it_belongs() -> None:
    frame = made_frame()
    tiles = [
        Tile(frame=replace(frame, time=float(k)), label=f"seed {k}", outcome="the end" * (k % 2))
        for k in range(5)
    ]
    whole = paint_mosaic(tiles, 3, (200, 120))
    assert whole.shape == (240, 600, 3)
    for k, tile in enumerate(tiles):
        row, column = divmod(k, 3)
        place = whole[row * 120 : (row + 1) * 120, column * 200 : (column + 1) * 200]
        np.testing.assert_array_equal(place, paint_mosaic([tile], 1, (200, 120)))
    assert len(np.unique(whole[120:, 400:].reshape(-1, 3), axis=0)) == 1  # There is no sixth.
    assert not np.array_equal(whole[:120, :200], whole[:120, 400:])


def test_a_tile_shows_truth_belief_and_outcome() -> None:
    frame = made_frame()
    for success, style in ((True, "home"), (False, "doorway")):
        tile = Tile(frame=frame, label="seed 7", outcome="ended", is_success=success)
        image = paint_mosaic([tile], 1, (400, 240))
        assert tuple(image[120, 0]) == PALETTE[style]
        assert tuple(image[120, -1]) == PALETTE[style]
    left, right = (half.reshape(-1, 3) for half in (image[:, :200], image[:, 200:]))
    for half, shown, hidden in ((left, "path", "believed"), (right, "believed", "path")):
        assert (half == PALETTE["wall"]).all(axis=1).any()
        assert _near(half, shown) > 10
        assert hidden == "believed" or _near(half, hidden) == 0
    running = paint_mosaic([Tile(frame=frame, label="seed 7")], 1, (400, 240))
    assert tuple(running[120, 0]) not in (PALETTE["home"], PALETTE["doorway"], PANEL)
    np.testing.assert_array_equal(running[40:236, 10:390], image[40:236, 10:390])


def _near(pixels: np.ndarray, style: str) -> int:
    """How many pixels have about a colour: edges are smooth."""
    return int((np.abs(pixels.astype(int) - PALETTE[style]).max(axis=1) < 40).sum())


@pytest.mark.parametrize("columns", range(1, 11))
def test_tiles_have_even_sizes_that_can_be_read(columns: int) -> None:
    width, height = tile_size(columns)
    assert NARROWEST <= width <= WIDEST
    assert width % 2 == height % 2 == 0
    assert width / height == pytest.approx(5 / 3, rel=0.02)


def test_a_long_label_stays_in_its_tile() -> None:
    tile = Tile(frame=made_frame(), label="seed 5 " * 30, outcome="the end")
    image = paint_mosaic([tile, Tile(frame=made_frame())], 2, (200, 120))
    np.testing.assert_array_equal(
        image[:, 200:], paint_mosaic([Tile(frame=made_frame())], 1, (200, 120))
    )


def test_png_bytes_are_read_back(tmp_path: Path) -> None:
    picture = paint_array(lay_out(made_frame()), (321, 241))
    (tmp_path / "a.png").write_bytes(png_bytes(picture))
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), picture)
