"""Other simulators: what is not installed is told, and so are wrong ranges. No test of speed."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from albot_benchmarks import peers as measuring
from albot_benchmarks.peer_simulations import Peer, Scene
from albot_benchmarks.peers import PEERS, measure_peers
from albot_cli.group import albot
from albot_cli.peers_page import page
from albot_core.errors import InputError
from albot_env.stress.geometry import ray_ranges

WORLD = "random:maze:1"
ABSENT = Peer("not here", "no-such-package", "no_such_package", lambda scene: Fake(scene, 0))


class Fake:
    """Robots that stand still and measure some share of a range too much."""

    def __init__(self, scene: Scene, excess: float) -> None:
        self._scene, self._excess = scene, excess

    def step(self, commands: np.ndarray) -> None:
        assert commands.shape == (len(self._scene.starts), 2)

    def poses(self) -> np.ndarray:
        return self._scene.starts

    def ranges(self) -> np.ndarray:
        walls, bearings = self._scene.world.walls, self._scene.geometry.bearings
        exact = np.array([ray_ranges(walls, pose, bearings) for pose in self.poses()])
        return exact * (1 + self._excess)


def fake(excess: float) -> Peer:
    return Peer(f"fake {excess}", "pytest", "pytest", lambda scene: Fake(scene, excess), robots=2)


@pytest.fixture(autouse=True)
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "TURN", 0.0)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")


def measured(*peers: Peer, beams: tuple[int, ...] = (64,)) -> list[dict[str, Any]]:
    return measure_peers(peers, (WORLD,), beams, rounds=1)


def test_without_any_peer_ours_is_measured_and_the_others_are_told_as_missing() -> None:
    first, second, missing = measured(ABSENT)
    assert missing == {"name": "not here", "missing": "not installed"}
    assert (first["name"], first["ratio"], first["beams"]) == ("albot-env", 1.0, 64)
    assert first["range_error"] < 1e-4
    assert 0.005 < second["range_error"] < 0.01  # The median of a noise of 1 cm.
    assert not first["wrong"] and not second["wrong"]


def test_a_peer_whose_ranges_are_off_is_marked() -> None:
    *_, right, wrong, blind = measured(fake(0.0), fake(0.1), fake(np.nan))
    assert (right["off"], right["wrong"], right["version"]) == (0.0, False, pytest.__version__)
    assert wrong["off"] > measuring.MOST_OFF and wrong["wrong"]
    assert (blind["off"], blind["wrong"]) == (1.0, True)
    assert right["ratio"] > 0  # How large it is depends on what else the machine does.


def test_a_module_that_another_package_has_put_there_does_not_count() -> None:
    assert Peer("another's", "pytest", "numpy_no", lambda scene: Fake(scene, 0)).version is None
    assert Peer("its own", "pytest", "pytest", lambda scene: Fake(scene, 0)).version


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_the_ranges_of_those_that_are_installed_are_right(
    peer: Peer, capsys: pytest.CaptureFixture[str]
) -> None:
    if peer.version is None:
        pytest.skip(f"{peer.package} is not installed (extra bench)")
    few = Peer(peer.name, peer.package, peer.module, peer.start, min(peer.robots, 4))
    rows = measured(few, beams=(16, 181))
    assert [row["wrong"] for row in rows if row["name"] == peer.name] == [False, False]
    assert capsys.readouterr().out == ""


def test_the_command_writes_a_page_with_a_line_a_simulator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = (fake(0.0), fake(0.1), ABSENT)
    quick = partial(measure_peers, chosen, (WORLD, "square-loop"), (64, 181), rounds=1)
    monkeypatch.setattr(measuring, "measure_peers", quick)
    out = tmp_path / "peers.md"
    words = ["bench", "--part", "peers", "--out", str(out), "--json"]
    figures = json.loads(CliRunner().invoke(albot, words, catch_exceptions=False).stdout)
    assert len(figures["peers"]) == 4 * 4 + 1
    text = out.read_text()
    assert text == page(figures["peers"], figures["machine"])
    lines = [line.split(" | ") for line in text.splitlines() if line.startswith("| ")]
    assert lines[0][2:-1] == [
        f"`{world}` ({walls} walls), {beams} beams"
        for world, walls in ((WORLD, 72), ("square-loop", 8))
        for beams in (64, 181)
    ]
    assert [line[0] for line in lines[1:]] == [
        "| albot-env",
        "| albot-env, with sonars and noise",
        f"| fake 0.0 {pytest.__version__}",
        f"| fake 0.1 {pytest.__version__}",
        "| not here",
    ]
    assert lines[1][2].endswith("(1.0 ×)")
    ranges = [line[-1] for line in lines[1:]]
    assert ranges[0] == ranges[2] == "exact |"
    assert ranges[1] == "0.7 cm |"
    assert ranges[3].startswith("**wrong**: up to ")
    assert ranges[4] == "not installed |"


def test_the_text_has_a_line_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = partial(measure_peers, (ABSENT, fake(0.1)), (WORLD,), (64,), rounds=1)
    monkeypatch.setattr(measuring, "measure_peers", quick)
    outcome = CliRunner().invoke(albot, ["bench", "--part", "peers"], catch_exceptions=False)
    lines = outcome.stdout.splitlines()[1:]
    assert all(line.startswith("peer  ") for line in lines)
    assert lines[0].endswith("albot-env, 64 beams in random:maze:1; ranges exact")
    assert "ranges **wrong**" in lines[2]
    assert lines[3] == "peer        not installed: not here"


@pytest.mark.parametrize("parts", [(), ("startup",), ("peers", "journey")])
def test_a_page_is_of_one_part(parts: tuple[str, ...], tmp_path: Path) -> None:
    words = [word for part in parts for word in ("--part", part)]
    outcome = CliRunner().invoke(albot, ["bench", *words, "--out", str(tmp_path / "page.md")])
    assert isinstance(outcome.exception, InputError)
    assert "--part journey or --part peers" in str(outcome.exception)
