"""Pictures of floor plans: every common way of storing one tells the same brightness."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from albot_core.errors import InputError
from albot_maps.formats.picture import find_picture, read_shades

SHADES = np.array([[0, 100, 205], [254, 255, 50]], np.uint8)


def plain(kind: str, most: int) -> bytes:
    """SHADES as a PGM in text, of brightness 0 to `most`."""
    numbers = " ".join(str(round(shade / 255 * most)) for shade in SHADES.ravel())
    return f"{kind}\n# comment\n3 2\n{most}\n{numbers}\n".encode()


def raw(most: int) -> bytes:
    """SHADES as a binary PGM of brightness 0 to `most`, of two bytes a pixel above 255."""
    kind = ">u2" if most > 255 else "u1"
    return b"P5\n3 2\n%d\n" % most + np.round(SHADES / 255 * most).astype(kind).tobytes()


def saved(image: Image.Image, kind: str, **options: object) -> bytes:
    stream = BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def grey() -> Image.Image:
    return Image.fromarray(SHADES)


def palette() -> Image.Image:
    """Indices into a palette that is not in order."""
    image = Image.fromarray(np.array([[3, 1, 0], [4, 5, 2]], np.uint8), "P")
    image.putpalette([each for shade in (205, 100, 50, 0, 254, 255) for each in [shade] * 3])
    return image


@pytest.mark.parametrize(
    ("name", "content", "off"),
    [
        ("raw 8 bits", raw(255), 0),
        ("raw 16 bits", raw(65535), 0.01),
        ("raw, 1023 at most", raw(1023), 0.2),
        ("raw, 100 at most", raw(100), 2),
        ("text", plain("P2", 255), 0),
        ("text, 16 bits", plain("P2", 65535), 0.01),
        ("text, 15 at most", plain("P2", 15), 9),
        ("PNG", saved(grey(), "PNG"), 0),
        ("PNG, 16 bits", saved(Image.fromarray(SHADES.astype(np.uint16) * 257), "PNG"), 0.01),
        ("PNG, grey and opaque", saved(grey().convert("LA"), "PNG"), 0),
        ("PNG, palette", saved(palette(), "PNG"), 0),
        ("PNG, colours", saved(grey().convert("RGB"), "PNG"), 0),
        ("PNG, colours and opaque", saved(grey().convert("RGBA"), "PNG"), 0),
        ("BMP", saved(grey(), "BMP"), 0),
        ("GIF", saved(palette(), "GIF"), 0),
        ("PPM", saved(grey().convert("RGB"), "PPM"), 0),
        ("JPEG", saved(grey(), "JPEG", quality=100), 4),
    ],
)
def test_brightness_is_the_same_however_it_is_stored(tmp_path, name, content, off):
    path = tmp_path / "map"
    path.write_bytes(content)
    assert read_shades(path) == pytest.approx(SHADES.astype(float), abs=off + 1e-9), name


@pytest.mark.parametrize("kind", ["PNG", "PPM", "BMP"])
def test_one_bit_a_pixel_is_black_or_white(tmp_path, kind):
    path = tmp_path / "map"
    path.write_bytes(saved(grey().point(lambda shade: 255 * (shade > 128), "1"), kind))
    assert read_shades(path).tolist() == [[0, 0, 255], [255, 255, 0]]


def test_what_is_transparent_is_neither_dark_nor_light(tmp_path):
    colours = np.dstack([SHADES] * 3 + [np.array([[255, 0, 255], [127, 128, 255]], np.uint8)])
    Image.fromarray(colours).save(tmp_path / "map.png")
    shades = read_shades(tmp_path / "map.png")
    assert np.isnan(shades).tolist() == [[False, True, False], [True, False, False]]
    assert shades[0, 2] == 205


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (saved(Image.fromarray(SHADES.astype(np.uint16)), "PNG"), "255 at most; convert it to 8"),
        (b"Pf\n3 2\n-1.0\n" + bytes(24), "floating-point numbers"),
        (saved(grey(), "TIFF"), "BMP, GIF and JPEG are read, too; convert any other"),
        (saved(grey(), "WEBP"), "found another format"),
    ],
)
def test_other_pictures_say_what_to_convert(tmp_path, content, words):
    path = tmp_path / "map"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        read_shades(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "there", "found", "note"),
    [
        ("a.png", "a.png", "a.png", ""),
        ("maps/a.png", "maps/a.png", "maps/a.png", ""),
        ("maps/a.png", "a.png", "a.png", "maps/a.png is missing; used a.png"),
        ("/home/of/others/a.png", "a.png", "a.png", "/home/of/others/a.png is missing; used a.png"),
        ("C:\\maps\\a.png", "a.png", "a.png", "C:\\maps\\a.png is missing; used a.png"),
        ("a.pgm", "a.pgm.gz", "a.pgm.gz", ""),
        ("/gone/a.pgm", "a.pgm.gz", "a.pgm.gz", "/gone/a.pgm is missing; used a.pgm.gz"),
    ],
)
def test_a_picture_is_where_the_file_says_or_beside_it(tmp_path, name, there, found, note):
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).write_bytes(b"")
    assert find_picture(tmp_path, name) == (tmp_path / found, note)


@pytest.mark.parametrize("name", ["", ".", "/", "gone.png", "maps/", "x\0y"])
def test_no_picture(tmp_path, name):
    (tmp_path / "maps").mkdir()
    assert find_picture(tmp_path, name) is None
