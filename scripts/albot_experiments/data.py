"""Where the real logs are, which the project does not bring."""

from __future__ import annotations

import os
from pathlib import Path

from albot_core.errors import InputError

VARIABLE = "ALBOT_DATA"
"""The environment variable that names the folder with the logs."""


def data_folder() -> Path:
    """The folder with the real logs.

    Raises:
        InputError: The environment names none.
    """
    named = os.environ.get(VARIABLE)
    if not named:
        raise InputError(VARIABLE, "the folder that holds the real logs, as logs/", "not set")
    if not (Path(named) / "logs").is_dir():
        raise InputError(VARIABLE, "a folder that holds logs/", named)
    return Path(named)
