"""`albot agents`: the agents."""

from __future__ import annotations

import json

import click


@click.group()
def command() -> None:
    """The agents that drive robots."""


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def list_agents(as_json: bool) -> None:
    """List the agents and what each does."""
    from albot_agents.registry import AGENTS, make_agent

    rows = [
        {
            "name": name,
            "summary": entry.summary,
            "mapper": entry.mapper,
            "knows_truth": make_agent(name).knows_truth,
        }
        for name, entry in AGENTS.items()
    ]
    if as_json:
        click.echo(json.dumps({"agents": rows}))
        return
    width = max(map(len, AGENTS))
    for row in rows:
        click.echo(f"{row['name']:<{width}}  {row['summary']}")
