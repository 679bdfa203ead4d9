"""Read pictures of floor plans: how bright each pixel is."""

from __future__ import annotations

import struct
import warnings
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from PIL import Image, UnidentifiedImageError

from albot_core.errors import InputError
from albot_core.files import exists, read_bytes

LARGEST = 1 << 24
"""Largest number of cells of a picture: 200 m by 200 m in cells of 5 cm. A file of a few kilobytes
can unpack to more than fits in memory."""
_BYTES = 6
"""Largest number of bytes per cell in a file: five digits and a space."""
_FORMATS = ("PNG", "PPM", "BMP", "GIF", "JPEG")
_CORRUPT = (OSError, SyntaxError, ValueError, EOFError, IndexError, OverflowError, struct.error)
"""What Pillow raises for truncated or corrupt files."""
_INTACT = "an intact PGM or PNG image"
_DEEP = 65535
"""Brightness of white in a picture with 16 bits per pixel."""


def read_shades(path: Path) -> Float64[np.ndarray, "rows columns"]:
    """Return the picture's brightness, 0 to 255; of a coloured picture, the mean of its channels.

    PNG, PGM, PPM, PBM, BMP, GIF and JPEG pictures of up to 16 bits per channel can be read. The
    brightness of a pixel that is more than half transparent is NaN: it is neither dark nor light.
    A picture of more than `LARGEST` cells is not unpacked.

    Raises:
        InputError: The file cannot be read, is no such picture, or has more than `LARGEST` cells.
    """
    content = read_bytes(path, _BYTES * LARGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # We count the cells.
            picture = Image.open(BytesIO(content), formats=_FORMATS)
        with picture:
            _check_picture(path, picture)
            return _shades(path, picture)
    except InputError:
        raise
    except UnidentifiedImageError:  # Its message contains a memory address.
        expected = f"{_INTACT} (BMP, GIF and JPEG are read, too; convert any other)"
        raise InputError(path, expected, "another format") from None
    except Image.DecompressionBombError:
        raise InputError(path, f"{LARGEST:,} cells at most", "more") from None
    except _CORRUPT as error:
        raise InputError(path, _INTACT, str(error)) from None


def _check_picture(path: Path, picture: Image.Image) -> None:
    """Raise InputError for a picture that is too large or has an unsupported mode.

    This happens before the picture is unpacked.
    """
    width, height = picture.size
    if width * height > LARGEST:
        raise InputError(path, f"{LARGEST:,} cells at most", f"{width:,} x {height:,}")
    if picture.mode.startswith("F"):
        expected = "8 or 16 bits a channel (convert the picture)"
        raise InputError(path, expected, f"floating-point numbers, mode {picture.mode}")


def _shades(path: Path, picture: Image.Image) -> Float64[np.ndarray, "rows columns"]:
    if picture.mode.startswith("I"):
        deep = np.asarray(picture, np.float64)
        if deep.max(initial=0.0) < 256:  # Eight bits stored as sixteen would all be black.
            expected = f"brightness from 0 to {_DEEP} in a picture with 16 bits a pixel"
            found = f"{deep.max(initial=0.0):.0f} at most; convert it to 8 bits"
            raise InputError(path, expected, found)
        return np.asarray(deep * (255 / _DEEP))
    clear = picture.has_transparency_data
    colours = np.asarray(picture.convert("RGBA" if clear else "RGB"))
    shades: Float64[np.ndarray, "rows columns"] = np.asarray(colours[..., :3].mean(axis=2))
    if clear:
        shades[colours[..., 3] < 128] = np.nan
    return shades


def find_picture(folder: Path, name: str) -> tuple[Path, str] | None:
    """Return a file's picture, and a note if it is not where the file says; None without one.

    A picture is looked for at its path, which is relative to `folder`, and then beside the file:
    files keep the paths of the machine that wrote them. It may be compressed (`.gz`).
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    if not last:
        return None
    for path, note in ((folder / name, ""), (folder / last, f"{name} is missing; used {last}")):
        for choice in (path, path.with_name(f"{path.name}.gz") if path.name else path):
            if exists(choice) and not choice.is_dir():
                packed = note and choice != path
                return choice, f"{note}.gz" if packed else note
    return None
