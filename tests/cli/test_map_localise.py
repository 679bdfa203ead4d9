"""`albot map --localise`: a robot finds out where it is in an earlier map."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from albot_cli.group import albot
from albot_core.logs.example import EXAMPLE
from albot_core.mappers.map_file import load_map, save_map
from albot_core.mappers.registry import make_mapper
from tests.cli.conftest import expect_error
from tests.cli.conftest import figures as parsed


def called(*words: str) -> Result:
    return CliRunner().invoke(albot, ["map", *words])


def figures(*words: str) -> dict[str, Any]:
    return parsed(called(*words, "--json"))


KEYS = {
    "map",
    "extended",
    "standing",
    "hypotheses",
    "localised_share",
    "localised_after_m",
    "localised_after_scans",
    "losses",
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """A map of the example's building."""
    folder = tmp_path_factory.mktemp("first")
    figures(str(EXAMPLE), "--mapper", "scan-matching", "--out", str(folder / "first"))
    return folder / "first" / "map.albot"


@pytest.fixture(scope="module")
def later(tmp_path_factory) -> Path:
    """The same log without its first third: the robot begins elsewhere."""
    lines = gzip.decompress(EXAMPLE.read_bytes()).decode().splitlines(keepends=True)
    path = tmp_path_factory.mktemp("later") / "later.log"
    path.write_text("".join(lines[len(lines) // 3 :]))
    return path


def test_the_robot_is_localised_and_the_map_stays_as_it_was(saved, later, tmp_path):
    found = figures(str(later), "--localise", str(saved), "--out", str(tmp_path / "second"))
    localisation = found["localisation"]
    assert found["mapper"] == "scan-matching"  # The map's.
    assert set(localisation) == KEYS and localisation["map"] == str(saved)
    assert localisation["standing"] == "localised" and not localisation["extended"]
    assert localisation["losses"] == 0 and localisation["localised_share"] > 0.8
    assert 2.5 <= localisation["localised_after_m"] < 10.0
    assert found["ate_rmse_m"] < 0.1
    again = load_map(tmp_path / "second" / "map.albot")
    assert again.estimate.updates == load_map(saved).estimate.updates
    _, *located = (tmp_path / "second" / "trajectory.tum").read_text().splitlines()
    assert len(located) == found["scans"] - localisation["localised_after_scans"]


def test_the_map_is_extended(saved, later, tmp_path):
    out = str(tmp_path / "more")
    found = figures(str(later), "--localise", str(saved), "--extend", "--out", out)
    assert found["localisation"]["extended"]
    more = load_map(tmp_path / "more" / "map.albot")
    assert more.estimate.updates > load_map(saved).estimate.updates


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--extend"], "--extend: expected --localise MAPFILE"),
        (["--localise", "SAVED", "--mapper", "albot1"], "expected a map of albot1"),
        (["--localise", "nowhere.albot"], "nowhere.albot"),
        (["--localise", "EMPTY"], "empty.albot: expected a map with walls"),
        (["--localise", str(EXAMPLE)], "example.log.gz"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(options, message, saved, tmp_path):
    save_map(make_mapper("scan-matching"), tmp_path / "empty.albot")
    files = {"SAVED": str(saved), "EMPTY": str(tmp_path / "empty.albot")}
    expect_error(called(*(files.get(word, word) for word in options)), message)
