"""What a reading costs each mapper, kept in the folder of a benchmark: `costs.json`.

Times differ from machine to machine, and from run to run. So they are kept apart from the episodes,
as ratios to `odometry`, measured beside it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from albot_core.files import write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record

_FILE = "costs.json"


def read_costs(folder: Path) -> dict[str, float]:
    """Return the cost a reading of each mapper, in costs of `odometry`; none without a file.

    Raises:
        InputError: The file is damaged.
    """
    file = folder / _FILE
    if not file.exists():
        return {}
    found = read_record({"costs": dict[str, float]}, read_json(file), Location(file))
    costs: dict[str, float] = found["costs"]
    return costs


def add_costs(folder: Path, costs: Mapping[str, float]) -> None:
    """Add costs to those that the folder has.

    Raises:
        InputError: The file is damaged, or cannot be written.
    """
    every = read_costs(folder) | dict(costs)
    text = json.dumps({"costs": dict(sorted(every.items()))}, indent=1)
    write_text(folder / _FILE, f"{text}\n")
