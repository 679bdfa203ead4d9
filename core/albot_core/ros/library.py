"""Whether the library `rosbags` is installed."""

from __future__ import annotations

from importlib.util import find_spec

from albot_core.errors import InputError

ROS_EXTRA = "pip install 'albot-env[ros]'"
"""The command that installs `rosbags`."""


def check_rosbags(source: object) -> None:
    """Check that `rosbags` is installed.

    Args:
        source: The bag, for the error.

    Raises:
        InputError: It is missing; the message says how to install it.
    """
    if find_spec("rosbags") is None:
        expected = f"what the extra `ros` brings ({ROS_EXTRA})"
        raise InputError(source, expected, "the package rosbags missing")
