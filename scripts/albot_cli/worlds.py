"""`albot worlds`: list, show, check, convert and make worlds."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_cli import completion
from albot_cli.number_types import CountType
from albot_cli.outputs import (
    FORCE,
    JSON,
    FigureFile,
    check_file,
    check_folder,
    check_png,
    figure_options,
    filled_folder,
    save_both,
)
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_cli.robots import robot_option
from albot_core.counts import many
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_maps import ROBOT_RADIUS, World, catalogue_names, load_world
from albot_maps.formats.world_file import world_text

_MOST_ON_A_SHEET = 100
_MOVABLES = {"doors": "door", "boxes": "box", "walkers": "walker"}
_WORLD = click.argument("spec", metavar="WORLD", shell_complete=completion.world_names)
_STRICT = click.option(
    "--strict", is_flag=True, help="Refuse a world if its reader left anything out."
)


@click.group()
def command() -> None:
    """List, show, check, convert and make worlds.

    WORLD is a name that `albot worlds list` prints, a random world (random:KIND:SEED), or
    a file: albot-world YAML, a ROS map (.yaml, .pgm, .png), an XML floor plan, a house of
    HouseExpo (.json), or a Stage world (.world); compressed (.gz, .xz) or not.
    """


@command.command("list")
@JSON
def list_worlds(as_json: bool) -> None:
    """List the worlds that come with the project."""
    worlds = [summary(load_world(name)) for name in catalogue_names()]
    if as_json:
        click.echo(json.dumps({"worlds": worlds}))
        return
    width = max(len(each["name"]) for each in worlds)
    for each in worlds:
        click.echo(f"{each['name']:{width}}  {one_line(each)}")


@command.command()
@_WORLD
@click.option("--png", type=PathType(), help="Draw its floor plan to a file.")
@figure_options("its floor plan")
@FORCE
@_STRICT
@JSON
def show(
    spec: str,
    png: Path | None,
    figure: FigureFile | None,
    force: bool,
    strict: bool,
    as_json: bool,
) -> None:
    """Describe WORLD, and draw it."""
    check_png(png, force=force)
    world = _load(spec, strict)
    facts = summary(world)
    if png is not None or figure is not None:
        from albot_maps.drawing import world_figure  # matplotlib is slow to load

        facts |= save_both(world_figure(world), png, figure)
    click.echo(json.dumps(facts) if as_json else in_full(facts))


@command.command()
@_WORLD
@robot_option
@_STRICT
@JSON
def check(spec: str, robot: str | None, strict: bool, as_json: bool) -> None:
    """Check that WORLD can be read and is valid; list what its reader left out.

    It is valid for a robot that can stand at its starts and reach its rooms.
    """
    radius = choose_robot(robot or DEFAULT_ROBOT, "--robot").radius
    facts = summary(_load(spec, strict, radius))
    if as_json:
        click.echo(json.dumps({"valid": True, **facts}))
        return
    click.echo(f"{spec}: a valid world, {one_line(facts)}")
    for note in facts["notes"]:
        click.echo(f"  note: {note}")


@command.command()
@_WORLD
@click.option("-o", "--out", type=PathType(), required=True, help="A .yaml file.")
@FORCE
@_STRICT
@JSON
def convert(spec: str, out: Path, force: bool, strict: bool, as_json: bool) -> None:
    """Write WORLD, whatever its format, as albot-world YAML."""
    if out.suffix not in {".yaml", ".yml"}:
        raise InputError("--out", "a name that ends in .yaml", str(out))
    check_file(out, force=force)
    world = _load(spec, strict)
    write_text(out, world_text(world))
    facts = {**summary(world), "out": str(out)}
    click.echo(json.dumps(facts) if as_json else f"{out}: {one_line(facts)}")


def _load(spec: str, strict: bool, robot_radius: float = ROBOT_RADIUS) -> World:
    """Load the world of a spec, for a robot of this radius (m).

    Raises:
        InputError: The world is invalid; or, if `strict`, its reader left out or assumed anything.
    """
    world = load_world(spec, robot_radius)
    if strict and world.notes:
        raise InputError(spec, "a world without notes, with --strict", "; ".join(world.notes))
    return world


class _MakeCommand(click.Command):
    """A command whose help lists the parameters of every kind of random world."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the parameters; only this loads the generators."""
        from albot_maps.generators.spec import KINDS, parameters_of

        for kind in KINDS:
            known = parameters_of(kind)
            defaults = known.defaults()
            rows = [
                (name, f"{allowed}  [default: {_default(defaults[name], allowed.usual)}]")
                for name, allowed in known.ranges().items()
            ]
            with formatter.section(f"Parameters of {kind}"):
                formatter.write_dl(rows)


def _default(value: object, usual: int | None) -> str:
    if usual is not None:
        return f"{usual}, or the nearest that is possible"
    return "chosen automatically" if value is None else str(value).lower()


@command.command(cls=_MakeCommand)
@click.argument("kind", shell_complete=completion.kind_names)
@click.option(
    "--count",
    type=CountType(1, 1_000_000),
    default=1,
    show_default=True,
    help="Number of worlds.",
)
@click.option(
    "--seed",
    type=CountType(0),
    default=0,
    show_default=True,
    help="Seed of the first world; the others follow.",
)
@click.option(
    "--param",
    "params",
    multiple=True,
    metavar="KEY=VALUE",
    help="Value of a parameter; repeatable.",
)
@click.option("--out", type=PathType(), help="The folder to write YAML files to.")
@click.option("--png", type=PathType(), help="Draw all of them on one sheet.")
@figure_options("all of them on one sheet")
@FORCE
@JSON
def make(
    kind: str,
    count: int,
    seed: int,
    params: tuple[str, ...],
    out: Path | None,
    png: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Make random worlds of a KIND: apartment, hall, maze, office, ring or warehouse."""
    check_png(png, force=force)
    is_drawn = png is not None or figure is not None
    if out is None and not is_drawn:
        raise InputError("albot worlds make", "--out DIR, --png FILE or --figure FILE", "none")
    if is_drawn and count > _MOST_ON_A_SHEET:
        raise InputError(
            "--png" if png else "--figure",
            f"at most {_MOST_ON_A_SHEET} worlds on one sheet",
            str(count),
        )
    query = "?" + "&".join(params) if params else ""
    if out is not None:
        names = (f"{kind}-{number}.yaml" for number in range(seed, seed + count))
        check_folder(out, names, force=force)
    made, drawn = [], []
    filled = nullcontext() if out is None else filled_folder(out)
    with filled as scratch, progress("make", count, "worlds") as update:
        for done in range(count):
            world = load_world(f"random:{kind}:{seed + done}{query}")
            if scratch is not None:
                write_text(scratch / f"{world.name}.yaml", world_text(world))
            if is_drawn:
                drawn.append(world)
            file = str(out / f"{world.name}.yaml") if out else None
            made.append({**summary(world), "file": file})
            update(done + 1)
    pictures: dict[str, str | None] = {"png": None, "figure": None}
    if is_drawn:
        from albot_maps.drawing import sheet_figure  # matplotlib is slow to load

        pictures |= save_both(sheet_figure(drawn), png, figure)
    rows = ((each["source"], one_line(each), each["file"]) for each in made)
    lines = ("  ".join(filter(None, row)) for row in rows)
    files = filter(None, pictures.values())
    facts = {"worlds": made, **pictures}
    click.echo(json.dumps(facts) if as_json else "\n".join((*lines, *files)))


def summary(world: World) -> dict[str, Any]:
    """Return the facts about a world that the command prints; lengths in metres."""
    x_min, y_min, x_max, y_max = world.bounds
    return {
        "name": world.name,
        "source": world.source,
        "size_m": [round(x_max - x_min, 3), round(y_max - y_min, 3)],
        "closed": world.closed,
        "walls": len(world.walls),
        "rooms": [room.name for room in world.rooms],
        "exits": {opening.name: list(opening.rooms) for opening in world.exits},
        "starts": world.starts.tolist(),
        "tours_m": {name: round(_length(points), 2) for name, points in world.tours.items()},
        "movables": {name: len(getattr(world.movables, name)) for name in _MOVABLES},
        "notes": list(world.notes),
    }


def one_line(facts: dict[str, Any]) -> str:
    """Return a world's size and the numbers of rooms, exits and walls."""
    width, height = facts["size_m"]
    parts = [f"{width:.1f} x {height:.1f} m"]
    parts += [many(len(facts[f"{kind}s"]), kind) for kind in ("room", "exit")]
    return ", ".join([*parts, many(facts["walls"], "wall")])


def in_full(facts: dict[str, Any]) -> str:
    """Return a world's facts, one per line."""
    width, height = facts["size_m"]
    x, y, heading = facts["starts"][0]
    rows = {
        "name": facts["name"],
        "source": facts["source"],
        "size": f"{width:.2f} x {height:.2f} m, {'closed' if facts['closed'] else 'open'}",
        "walls": str(facts["walls"]),
        "rooms": ", ".join(facts["rooms"]),
        "exits": ", ".join(f"{name} ({'–'.join(ends)})" for name, ends in facts["exits"].items()),
        "start": f"({x:.2f}, {y:.2f}) m, heading {np.rad2deg(heading):.0f}°",
        "tours": ", ".join(f"{name} ({length:.1f} m)" for name, length in facts["tours_m"].items()),
        "moving": ", ".join(
            many(n, _MOVABLES[name], name) for name, n in facts["movables"].items() if n
        ),
        "notes": "; ".join(facts["notes"]),
        "png": facts.get("png", ""),
        "figure": facts.get("figure", ""),
    }
    return "\n".join(f"{title:8}{text}" for title, text in rows.items() if text)


def _length(points: np.ndarray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
