"""The command that makes a recorded episode again."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from albot_env.recording.episode import EpisodeHeader

OPTIONS = ("world", "mapper", "robot", "laser", "odometer", "sonar", "scenes", "compass")
"""Settings that are options of `albot play` by the same name, if they are texts."""
FILES = {"config": "config.yml", "mapper_config": "mapper.yml"}
"""Settings that `albot play` takes from a file, and the name that the file gets."""
_NOBODY = ("", "keyboard")
"""Agents that the command cannot let act again: an unknown one, and a person."""
_OTHERS = ("render_mode", "movables", *OPTIONS, *FILES)


def play_command(header: EpisodeHeader, steps: int) -> str:
    """Return lines for a shell that make an episode again, by `albot play`.

    A configuration becomes a file in the present folder. JSON is YAML, too. The text is empty if
    the command cannot make the episode: no seed or agent is known, a person drove, a setting is
    none of its options, or the header does not hold the environment (`EpisodeHeader.spec`).

    Args:
        header: The episode's header.
        steps: Number of steps of the episode.
    """
    if header.spec is None or header.seed is None or header.agent in _NOBODY:
        return ""
    settings = dict(header.spec.get("kwargs") or {})
    texts = {name: settings[name] for name in OPTIONS if settings.get(name) is not None}
    configs = {name: settings[name] for name in FILES if settings.get(name)}
    if (
        settings.keys() - set(_OTHERS)
        or not all(isinstance(value, str) for value in texts.values())
        or not all(isinstance(value, Mapping) for value in configs.values())
    ):
        return ""
    words = ["albot", "play", header.environment]
    for name, value in texts.items():
        words += [f"--{name}", value]
    for name in configs:
        words += [f"--{name.replace('_', '-')}", FILES[name]]
    words += ["--agent", header.agent]
    words += ["--no-movables"] if settings.get("movables") is False else []
    words += ["--seed", str(header.seed), "--steps", str(max(steps, 1))]
    files = [_file(FILES[name], each) for name, each in configs.items()]
    return "\n".join([*files, shlex.join(words)])


def _file(name: str, content: Mapping[str, Any]) -> str:
    """Return the line that writes a configuration into a file."""
    return f"printf '%s' {shlex.quote(json.dumps(content))} > {name}"
