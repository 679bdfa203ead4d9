"""The command that makes a recorded episode again."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from albot_env.recording.episode import EpisodeHeader

OPTIONS = (
    "world", "mapper", "robot", "laser", "odometer", "sonar", "scenes", "compass", "faults",
    "saved_map",
)  # fmt: skip
"""Settings that are options of `albot play` by the same name, if they are texts."""
FILES = {"config": "config.yml", "mapper_config": "mapper.yml"}
"""Settings that `albot play` takes from a file, and the name that the file gets."""
_NOBODY = ("", "keyboard")
"""Agents that the command cannot let act again: an unknown one, and a person."""
_OTHERS = ("render_mode", "movables", *OPTIONS, *FILES)


def play_command(header: EpisodeHeader, steps: int) -> str:
    """Return lines for a shell that make a recorded episode again, as `play_lines`.

    The text is empty, too, if no seed or agent is known, a person drove, or the header does not
    hold the environment (`EpisodeHeader.spec`).

    Args:
        header: The episode's header.
        steps: Number of steps of the episode.
    """
    if header.spec is None or header.seed is None or header.agent in _NOBODY:
        return ""
    settings = header.spec.get("kwargs") or {}
    return play_lines(header.environment, settings, header.agent, header.seed, steps)


def play_lines(
    environment: str, settings: Mapping[str, Any], agent: str, seed: int, steps: int
) -> str:
    """Return lines for a shell that make an episode by `albot play`.

    A configuration becomes a file in the present folder. JSON is YAML, too. The text is empty if a
    setting is none of the command's options.

    Args:
        environment: Id of the environment.
        settings: Its settings as JSON has them (the `kwargs` of `EnvSpec.to_json`).
        agent: Name of the agent, or its file.
        seed: Seed of environment and agent.
        steps: Number of steps of the episode.
    """
    texts = {name: settings[name] for name in OPTIONS if settings.get(name) is not None}
    configs = {name: settings[name] for name in FILES if settings.get(name)}
    if (
        settings.keys() - set(_OTHERS)
        or not all(isinstance(value, str) for value in texts.values())
        or not all(isinstance(value, Mapping) for value in configs.values())
    ):
        return ""
    words = ["albot", "play", environment]
    for name, value in texts.items():
        words += [f"--{name.replace('_', '-')}", value]
    for name in configs:
        words += [f"--{name.replace('_', '-')}", FILES[name]]
    words += ["--agent", agent]
    words += ["--no-movables"] if settings.get("movables") is False else []
    words += ["--seed", str(seed), "--steps", str(max(steps, 1))]
    files = [_file(FILES[name], each) for name, each in configs.items()]
    return "\n".join([*files, shlex.join(words)])


def _file(name: str, content: Mapping[str, Any]) -> str:
    """Return the line that writes a configuration into a file."""
    return f"printf '%s' {shlex.quote(json.dumps(content))} > {name}"
