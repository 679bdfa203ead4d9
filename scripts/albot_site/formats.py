"""The pages of file formats: their JSON Schemas, and the fields of what they hold."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from albot_agents.trained import agent_file
from albot_agents.training.plan import TrainingPlan
from albot_core.config_document import field_docs
from albot_core.logs.reader import FORMATS
from albot_core.mappers import map_file
from albot_env.recording.schemas import TOPICS
from albot_site.configurations import fields_table
from albot_site.markdown import cell, code_cell, fenced, table
from albot_site.sources import ROOT

_WORLD_SCHEMA = ROOT / "maps/albot_maps/formats/albot-world.schema.json"
_PLANS = ROOT / "docs/plans"


def format_pages() -> dict[str, str]:
    """Return the pages of file formats by their addresses."""
    return {
        "reference/world_files.md": _worlds(),
        "reference/episode_files.md": _episodes(),
        "reference/agent_files.md": _agents(),
        "reference/plans.md": _plans(),
        "reference/log_files.md": _logs(),
    }


def _worlds() -> str:
    schema = json.loads(_WORLD_SCHEMA.read_text(encoding="utf-8"))
    return "\n".join(
        (
            "# World files\n",
            "A world is a YAML file. [Worlds](../worlds.md) tells what it means, and of the other "
            "formats that are read; `albot worlds check FILE` checks one. Its JSON Schema:\n",
            _schema(schema),
        )
    )


def _episodes() -> str:
    parts = [
        "# Episode files\n",
        "An episode is an [MCAP](https://mcap.dev) file with JSON messages, written as the episode "
        "runs: `albot play` and any environment with a recorder write it, `albot play FILE` plays "
        "it back, `albot map FILE` maps it. Foxglove and Lichtblick open it as it is.\n",
        table(
            ("topic", "schema"),
            (
                (code_cell(topic), f"[{schema['title']}](#{_anchor(schema)})")
                for topic, schema in TOPICS.items()
            ),
        ),
    ]
    schemas = {schema["title"]: schema for schema in TOPICS.values()}
    for title, schema in schemas.items():
        parts += [f"## {title} {{ #{_anchor(schema)} }}\n", _schema(schema)]
    return "\n".join(parts)


def _anchor(schema: dict[str, Any]) -> str:
    return str(schema["title"]).lower().replace(".", "-")


def _schema(schema: dict[str, Any]) -> str:
    return fenced(json.dumps(schema, indent=1, ensure_ascii=False), "json")


def _agents() -> str:
    return "\n".join(
        (
            "# Agent files and map files\n",
            "Both are zip archives of numeric arrays (`NAME.npy`) and one `header.json`, without "
            "executable code. The same content gives the same bytes.\n",
            f"## Agent files: `{agent_file.FORMAT.name}`, version {agent_file.FORMAT.version}\n",
            "`albot train` writes them, and `--agent FILE` reads them. The header holds:\n",
            _described(agent_file.AgentFile),
            "### training\n",
            _described(agent_file.TrainingFacts),
            f"## Map files: `{map_file.FORMAT}`, version {map_file.VERSION}\n",
            "`albot_core.mappers.map_file` writes and reads them. The header holds the name of the "
            "mapper and those of its parameters that differ from their defaults, as YAML; the "
            "arrays are the mapper's state.\n",
        )
    )


def _described(kind: Any) -> str:
    """Return a table of the fields of a dataclass and their docstrings."""
    meanings = field_docs(kind)
    names = (each.name for each in dataclasses.fields(kind))
    return table(
        ("field", "meaning"), ((code_cell(name), cell(meanings.get(name, ""))) for name in names)
    )


def _plans() -> str:
    parts = [
        "# Training plans\n",
        "A plan is a YAML file for `albot train`. [Training](../training.md) explains it; `albot "
        "train TASK --print-plan` prints a whole one.\n",
        fields_table(TrainingPlan()),
        "## Plans of the figures\n",
        "The runs in these pages were made with:\n",
    ]
    for path in sorted(_PLANS.glob("*.yml")):
        text = path.read_text(encoding="utf-8")
        parts += [f"### [{path.name}](../plans/{path.name})\n", fenced(text, "yaml")]
    return "\n".join(parts)


def _logs() -> str:
    names = "\n".join(f"- {name}" for name in FORMATS)
    return (
        "# Log files\n\n`albot map` and `albot compare` read logs of real robots in these formats, "
        "by their content, also packed with gzip or xz. [Real logs](../logs.md) describes them, "
        f"and what comes out; a guide tells how to [add one](../guides/log_format.md).\n\n{names}\n"
    )
