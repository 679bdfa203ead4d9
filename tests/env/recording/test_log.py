"""Episodes as logs, and the schemas of what they hold."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import pytest

from albot_env.recording.log import read_episode_log
from albot_env.recording.schemas import LAYER_SCHEMAS


def test_of_an_episode_that_was_never_closed_the_log_says_how_far_it_goes(
    episode: Path, tmp_path: Path
) -> None:
    torn = tmp_path / "torn.mcap"
    assert read_episode_log(episode).unread is None
    content = episode.read_bytes()
    torn.write_bytes(content[: len(content) * 3 // 4])
    unread = read_episode_log(torn).unread
    assert unread is not None
    assert (unread.lines, unread.scans) == (0, 0)
    assert unread.reason.startswith("torn.mcap: never closed, ends early; read up to its last")


@pytest.mark.parametrize(("kind", "extra"), [("particles", {"weights": [1.0]}), ("trajectory", {})])
def test_a_pose_in_a_map_has_three_numbers(kind: str, extra: dict[str, list[float]]) -> None:
    schema = LAYER_SCHEMAS[kind]
    jsonschema.validate({"poses": [[1.0, 2.0, 0.5]], **extra}, schema)
    for wrong in ([1.0, 2.0], [1.0, 2.0, 0.5, 0.0]):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({"poses": [wrong], **extra}, schema)
