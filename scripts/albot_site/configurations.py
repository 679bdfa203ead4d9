"""The pages of configurations: each field with default, range and meaning, from its dataclass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from albot_agents.task import config_kind, task_names, untwinned
from albot_cli.config import parameter_rows
from albot_core.config_document import field_docs
from albot_core.mappers.registry import MAPPERS, mapper_config
from albot_core.robot import ROBOTS
from albot_env.sim.compass import COMPASSES
from albot_env.sim.laser import LASERS
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.scenes import SCENES
from albot_env.sim.sonar import SONARS
from albot_maps.generators.spec import KINDS, parameters_of
from albot_site.markdown import cell, code_cell, table

_HEADS = ("field", "default", "range", "meaning")


def configuration_pages() -> dict[str, str]:
    """Return the pages of configurations by their addresses."""
    return {
        "reference/tasks.md": _tasks(),
        "reference/mappers.md": _mappers(),
        "reference/equipment.md": _equipment(),
        "reference/random_worlds.md": _random_worlds(),
    }


def own_tasks() -> list[str]:
    """Return the ids of all tasks but the twins that reveal the truth, which are alike."""
    return [task for task in task_names() if untwinned(task) == task]


def fields_table(config: Any) -> str:
    """Return a table of all fields of a configuration, and of those inside it."""
    rows = (
        (code_cell(row["name"]), _value(row["default"]), cell(row["range"]), cell(row["meaning"]))
        for row in parameter_rows(config)
    )
    return table(_HEADS, rows)


def _value(value: object) -> str:
    """Return a default as code: a number by six digits, a long list by its beginning."""
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return code_cell(text if len(text) <= 60 else f"{text[:57]}…")


def _tasks() -> str:
    parts = [
        "# Configurations of tasks\n",
        "The fields of `config` of each environment: `gymnasium.make(…, config={…})`, `--config` "
        "of `albot play` and `albot evaluate`, `env.config` of a training plan. `albot config "
        "TASK` prints them as a file. Lengths are in metres, times in seconds, angles in radians "
        "unless a field says otherwise. [Environments](../environments.md) tells what they do.\n",
    ]
    for task in own_tasks():
        parts += [f"## {task}\n", fields_table(config_kind(task)())]
    return "\n".join(parts)


def _mappers() -> str:
    parts = [
        "# Configurations of mappers\n",
        "The parameters of each mapper: `mapper_config` of the environments and `make_mapper`, "
        "`--mapper-config` of the commands. `albot mappers NAME` prints them as a file. "
        "[The systems](../systems.md) tells where each is from.\n",
    ]
    for spec in MAPPERS.values():
        layers = ", ".join(spec.layers) or "none"
        sensors = ", ".join(sorted(spec.sensors)) or "none but the odometer"
        parts += [
            f"## {spec.name}\n",
            f"{spec.summary} Source: {spec.paper}. Sensors: {sensors}. Layers: {layers}.\n",
            fields_table(mapper_config(spec)),
        ]
    return "\n".join(parts)


def _equipment() -> str:
    parts = [
        "# Robots and sensors\n",
        "The settings `robot`, `laser`, `sonar`, `odometer`, `scenes` and `compass` of the "
        "environments, by their names. A table shows the defaults of a configuration, and below it "
        "what each name changes.\n",
    ]
    kinds: dict[str, Mapping[str, Any]] = {
        "robot": ROBOTS,
        "laser": LASERS,
        "sonar": SONARS,
        "odometer": ODOMETERS,
        "scenes": SCENES,
        "compass": COMPASSES,
    }
    for setting, presets in kinds.items():
        default = type(next(iter(presets.values())))()
        parts += [f"## {setting}\n", fields_table(default)]
        rows = ((code_cell(name), _changes(preset, default)) for name, preset in presets.items())
        parts.append(table(("name", "differs in"), rows))
    return "\n".join(parts)


def _changes(preset: Any, default: Any) -> str:
    before = {row["name"]: row["default"] for row in parameter_rows(default)}
    rows = (row for row in parameter_rows(preset) if before.get(row["name"]) != row["default"])
    return ", ".join(code_cell(f"{row['name']}: {row['default']}") for row in rows) or "nothing"


def _random_worlds() -> str:
    parts = [
        "# Parameters of random worlds\n",
        "The parameters of each kind, as in `random:office:42?rooms=12`. [Worlds](../worlds.md) "
        "shows the kinds.\n",
    ]
    for kind in KINDS:
        known: Any = parameters_of(kind)
        defaults, meanings = known.defaults(), field_docs(known)
        rows = (
            (
                code_cell(name),
                code_cell("the generator's choice" if defaults[name] is None else defaults[name]),
                cell(allowed),
                cell(meanings[name]),
            )
            for name, allowed in known.ranges().items()
        )
        parts += [f"## random:{kind}\n", table(_HEADS, rows)]
    return "\n".join(parts)
