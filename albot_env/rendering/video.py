"""Videos: pictures encoded as MP4 (H.264) or GIF, written completely or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cache
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

from albot_core.errors import InputError
from albot_core.files import atomic_write

if TYPE_CHECKING:
    from PIL import Image

VIDEO_EXTRA = "pip install 'albot-env[video]'"
"""The command that installs what videos need."""
RATE = 20
"""Pictures per second. GIF counts in hundredths of a second, so that few rates are exact."""
_QUALITY = "20"
"""Constant rate factor of H.264: at this one, lines of two pixels stay sharp."""
_SHADES = 9
"""Shades between a colour and what is beneath it, for smooth edges and letters in a GIF."""
SUFFIXES = (".mp4", ".gif")
"""Endings of the names of videos: their formats."""


def check_video_name(path: Path, source: object = None) -> str:
    """Return the ending of a video's name, in small letters.

    Args:
        path: The video.
        source: What is named as the place in errors; by default the path.

    Raises:
        InputError: It is none of `SUFFIXES`, or the extra `video` is not installed.
    """
    source, suffix = path if source is None else source, path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(source, f"a name that ends in {' or '.join(SUFFIXES)}", str(path))
    if find_spec("av") is None:
        raise InputError(source, f"the package of the extra `video` ({VIDEO_EXTRA})", "no av")
    return suffix


class VideoWriter:
    """Encodes pictures, one after another. `open_video` makes it.

    A GIF has 256 colours at most: those of the painted pictures (see `canvas`).

    Args:
        stream: Where the video is written.
        suffix: Its format: one of `SUFFIXES`.
        rate: Pictures per second.
    """

    def __init__(self, stream: IO[bytes], suffix: str, rate: int) -> None:
        import av  # of the extra `video`, and slow to load

        self.rate = rate
        """Pictures per second."""
        self.count = 0
        """Number of pictures so far."""
        self._av: Any = av
        self._is_gif = suffix == ".gif"
        self._size = (0, 0)
        self._container = av.open(stream, "w", format=suffix[1:])
        self._stream = self._open_stream()

    def _open_stream(self) -> Any:
        if self._is_gif:
            stream = self._container.add_stream("gif", rate=self.rate)
            stream.pix_fmt = "pal8"
            return stream
        try:
            stream = self._container.add_stream("h264", rate=self.rate)
        except ValueError as error:
            raise InputError(
                "video", "an encoder for H.264 in the package av", str(error)
            ) from None
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": _QUALITY}
        # Players guess a video's colours by its size, unless it names them.
        context = stream.codec_context
        context.colorspace = self._av.video.reformatter.Colorspace.ITU709
        context.color_primaries = self._av.video.reformatter.ColorPrimaries.BT709
        context.color_trc = self._av.video.reformatter.ColorTrc.BT709
        context.color_range = self._av.video.reformatter.ColorRange.MPEG
        return stream

    def add(self, picture: UInt8[np.ndarray, "h w 3"], count: int = 1) -> None:
        """Append a picture.

        Args:
            picture: Rows of RGB pixels. All pictures of a video have one size; an MP4 repeats the
                last row or column where their number is odd.
            count: Number of times that it is shown.

        Raises:
            ValueError: It has another size than the first one.
        """
        size = picture.shape[1], picture.shape[0]
        if not self.count:
            self._begin(*size)
        elif size != self._size:
            raise ValueError(f"a picture of {size} pixels in a video of {self._size}")
        frame = self._gif_frame(picture) if self._is_gif else self._mp4_frame(picture)
        for _ in range(count):
            frame.pts = self.count
            self._container.mux(self._stream.encode(frame))
            self.count += 1

    def _begin(self, width: int, height: int) -> None:
        self._size = width, height
        even = 1 if self._is_gif else 2  # Colours are stored for squares of two pixels by two.
        self._stream.width, self._stream.height = (
            -(-width // even) * even,
            -(-height // even) * even,
        )

    def _mp4_frame(self, picture: UInt8[np.ndarray, "h w 3"]) -> Any:
        height, width, _ = picture.shape
        whole = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        frame = self._av.VideoFrame.from_ndarray(whole, format="rgb24")
        return frame.reformat(format="yuv420p", dst_colorspace="ITU709")

    def _gif_frame(self, picture: UInt8[np.ndarray, "h w 3"]) -> Any:
        from PIL import Image

        colours = _gif_colours()
        indices = Image.fromarray(picture).quantize(palette=colours, dither=Image.Dither.NONE)
        palette = np.full((256, 4), 255, np.uint8)  # Alpha, red, green and blue.
        palette[:, 1:] = np.array(colours.getpalette(), np.uint8).reshape(-1, 3)
        return self._av.VideoFrame.from_ndarray((np.asarray(indices), palette), format="pal8")

    def finish(self) -> None:
        """Write what the encoder still holds; no picture can follow."""
        if self.count:
            self._container.mux(self._stream.encode(None))

    def close(self) -> None:
        """Write the file's index, and free the encoder."""
        self._container.close()


@cache
def _gif_colours() -> Image.Image:
    """Return a picture whose palette has the colours of painted pictures, and their shades."""
    from PIL import Image

    from albot_env.rendering import canvas

    drawn = [*dict.fromkeys(canvas.PALETTE.values()), canvas.TEXT, canvas.FAINT, canvas.ACCENT]
    pairs = [*product(drawn, [canvas.PANEL]), (canvas.TEXT, canvas.BACKGROUND)]
    pairs.append((canvas.OCCUPIED, canvas.FREE))
    ramps = [np.linspace(below, above, _SHADES) for above, below in pairs]
    colours = np.unique(np.concatenate(ramps).round().astype(np.uint8), axis=0)
    assert len(colours) <= 256, "a GIF has 256 colours at most"
    image = Image.new("P", (1, 1))
    image.putpalette(np.resize(colours, (256, 3)).tobytes())
    return image


@contextmanager
def open_video(path: Path, rate: int = RATE) -> Iterator[VideoWriter]:
    """Open a video that is written when the block ends without an error, and otherwise not at all.

    Args:
        path: The file, with one of `SUFFIXES` in small or capital letters.
        rate: Pictures per second.

    Raises:
        InputError: See `check_video_name`; or the file cannot be written.
    """
    suffix = check_video_name(path)
    with atomic_write(path) as stream, closing(VideoWriter(stream, suffix, rate)) as video:
        yield video
        video.finish()
