"""Colours over each other can be told apart by everybody, and stand in one place."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from albot_core.drawing import palette
from albot_core.drawing.palette import DARK, DARK_GROUND, LIGHT, PAPER, SERIES, rgb

VISIONS = {
    "normal": np.eye(3),
    "protanopia": ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216),
                   (-0.003882, -0.048116, 1.051998)),
    "deuteranopia": ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413),
                     (-0.011820, 0.042940, 0.968881)),
    "tritanopia": ((1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602),
                   (0.004733, 0.691367, 0.303900)),
}  # fmt: skip
"""Machado, Oliveira & Fernandes 2009, severity 1, for linear RGB."""
TO_XYZ = np.array(
    ((0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750),
     (0.0193339, 0.1191920, 0.9503041))
)  # fmt: skip
APART = 20.0
"""Least ΔE*ab of colours that lie over each other."""
TRUTH = ("wall", "laser", "thing", "path", "home")
MAP = ("surface", "doorway", "place", "believed", "corrected", "particle", "home")
"""What is drawn over each other in the panel of the truth, and in that of the map."""


def lab(colour: str, vision: str) -> np.ndarray:
    """The colour in CIELAB (D65), as seen with a deficiency."""
    share = np.array(rgb(colour)) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(VISIONS[vision]) @ linear, 0, 1)
    x, y, z = TO_XYZ @ seen / (0.95047, 1.0, 1.08883)
    x, y, z = (np.cbrt(t) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
    return np.array((116 * y - 16, 500 * (x - y), 200 * (y - z)))


def difference(one: str, other: str, vision: str) -> float:
    return float(np.linalg.norm(lab(one, vision) - lab(other, vision)))


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("panel", [TRUTH, MAP])
@pytest.mark.parametrize(("colours", "ground"), [(LIGHT, PAPER), (DARK, DARK_GROUND)])
def test_colours_over_each_other_differ(
    colours: dict[str, str], ground: str, panel: tuple[str, ...], vision: str
) -> None:
    shown = {style: colours[style] for style in panel} | {"ground": ground}
    for one, other in itertools.combinations(shown, 2):
        assert difference(shown[one], shown[other], vision) >= APART, (one, other)


@pytest.mark.parametrize("vision", VISIONS)
def test_kinds_without_a_colour_of_their_own_differ(vision: str) -> None:
    for one, other in itertools.combinations((*SERIES, PAPER), 2):
        assert difference(one, other, vision) >= APART


def test_the_measure_knows_red_and_green() -> None:
    assert difference("#2b8a3e", "#d9480f", "normal") > 80
    assert difference("#2b8a3e", "#d9480f", "deuteranopia") < 40
    assert lab("#ffffff", "normal") == pytest.approx((100, 0, 0), abs=0.1)


def test_light_and_dark_colour_the_same_shapes() -> None:
    assert LIGHT.keys() == DARK.keys()


def test_no_other_module_has_colours_of_its_own() -> None:
    root = Path(palette.__file__).parents[3]
    packages = ("core", "maps", "albot_env", "agents", "scripts")
    sources = [path for package in packages for path in (root / package).rglob("*.py")]
    assert len(sources) > 200
    for path in sources:
        if path != Path(palette.__file__):
            found = re.findall(r"\"#[0-9a-fA-F]{6}\"|\"tab:|\"C\d\"", path.read_text())
            assert not found, f"{path}: {found}"
