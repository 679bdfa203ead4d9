"""Figures are saved in the format of their names, and the same bytes each time."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image

from albot_core.drawing.figure import SUFFIXES, draw_scale_bar, round_length, save_figure
from albot_core.errors import InputError


def drawn() -> Figure:
    figure = Figure(figsize=(3, 2), layout="constrained")
    axes = figure.add_subplot(title="A corridor")
    axes.plot([0, 4], [0, 3], label="path")
    axes.legend()
    return figure


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_figure_has_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    for name in ("a", "b"):
        save_figure(drawn(), tmp_path / f"{name}{suffix}")
    one, other = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert one == other
    assert b"Date" not in one
    save_figure(drawn(), tmp_path / f"c{suffix.upper()}")
    assert (tmp_path / f"c{suffix.upper()}").read_bytes() == one


def test_vector_graphics_keep_text_as_text(tmp_path: Path) -> None:
    save_figure(drawn(), tmp_path / "a.svg")
    assert ">A corridor</text>" in (tmp_path / "a.svg").read_text()
    save_figure(drawn(), tmp_path / "a.pdf")
    content = (tmp_path / "a.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert b"/TrueType" in content or b"/Type0" in content or b"/CIDFontType2" in content


def test_a_png_has_as_many_dots_as_asked_for(tmp_path: Path) -> None:
    widths = []
    for dpi in (100, 300):
        save_figure(drawn(), tmp_path / "a.png", dpi)
        with Image.open(tmp_path / "a.png") as picture:
            widths.append(picture.width)
            assert picture.info["dpi"] == pytest.approx((dpi, dpi), abs=0.1)
    assert widths[1] == pytest.approx(3 * widths[0], abs=3)


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.png.gz"])
def test_a_name_without_a_format_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"a name that ends in \.png, \.pdf or \.svg, found"):
        save_figure(drawn(), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("width", "bar"), [(10.0, 2.0), (31.6, 5.0), (9.9, 1.0), (400.0, 50.0)])
def test_the_scale_bar_is_round(width: float, bar: float) -> None:
    assert round_length(width) == pytest.approx(bar)


@given(st.floats(0.01, 1e5))
def test_the_scale_bar_is_a_fifth_at_most_and_more_than_a_thirteenth(width: float) -> None:
    assert width / 13 < round_length(width) <= width / 5 * 1.002


def test_the_scale_bar_is_as_long_as_it_says() -> None:
    axes = Figure().add_subplot(xlim=(0, 30))
    draw_scale_bar(axes, 5.0)
    assert axes.get_lines()[0].get_xdata().tolist() == [25.0, 30.0]
    assert [text.get_text() for text in axes.texts] == ["5 m"]
