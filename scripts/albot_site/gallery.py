"""The gallery: each mapper, task, kind of world and agent, drawn by one command.

What acts has a picture and a clip, a world has a picture.
"""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from PIL import Image

from albot_agents.registry import agent_names, find_agent
from albot_agents.task import short_name
from albot_cli.group import albot
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.files import atomic_write
from albot_core.mappers.registry import MAPPERS
from albot_maps.generators.spec import KINDS
from albot_maps.load import catalogue_names
from albot_site.configurations import own_tasks
from albot_site.sources import ROOT

FOLDER = ROOT / "docs/gallery"
"""Where the pictures are; git ignores them."""
_WIDTH, _COLOURS = 1000, 64
_SPEED = "40"
"""How many times faster than real time a clip is."""
_STEPS = {"explore": 2500, "place-recognition": 30}
"""Steps of an episode that shows something, by task; the others end by themselves."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One picture of the gallery."""

    group: str
    """The heading under which it stands."""
    name: str
    """What it shows."""
    text: str
    """What is to be said of that, in a line."""
    command: str
    """The command that draws it, without the file."""

    @property
    def file(self) -> str:
        """The name of its file."""
        return f"{self.group.split()[0].lower()}-{self.name.replace(':', '-')}.png"

    @property
    def clip(self) -> str | None:
        """The name of the file of its clip; None for what does not move."""
        return f"{Path(self.file).stem}.mp4" if self.command.startswith("albot play") else None


def shots() -> Iterator[Shot]:
    """Yield all pictures in their order."""
    for task in own_tasks():
        name = short_name(task)
        command = f"albot play {name} --headless --steps {_STEPS.get(name, 3000)}"
        yield Shot(group="Tasks", name=name, text=f"`{task}`", command=command)
    for spec in MAPPERS.values():
        extra = " --scenes paper" if "scene" in spec.sensors else ""
        extra += " --compass polarised" if "compass" in spec.sensors else ""
        command = f"albot play explore --mapper {spec.name} --headless --steps 600{extra}"
        yield Shot(group="Mappers", name=spec.name, text=spec.summary, command=command)
    for agent in agent_names():
        entry = find_agent(agent)
        name = short_name(entry.tasks[0])
        command = f"albot play {name} --agent {agent} --headless --steps {_STEPS.get(name, 3000)}"
        yield Shot(group="Agents", name=agent, text=entry.summary, command=command)
    for kind in KINDS:
        world = f"random:{kind}:1"
        command = f"albot worlds show {world}"
        yield Shot(group="Random worlds", name=world, text="", command=command)
    for world in catalogue_names():
        command = f"albot worlds show {world}"
        yield Shot(group="Worlds of the catalogue", name=world, text="", command=command)


def draw(shot: Shot, folder: Path = FOLDER) -> None:
    """Draw a picture and a clip by their command, and write them small.

    Raises:
        InputError: The command refuses its work, as where an extra is not installed.
        OSError: The disk is full.
    """
    with tempfile.TemporaryDirectory() as place:
        png = Path(place) / "shot.png"
        words = [*shlex.split(shot.command)[1:], "--png", str(png), "--json"]
        if words[0] == "play":
            words += ["--record", str(Path(place) / "shot.mcap")]
            words += ["--video", str(Path(place) / "shot.mp4"), "--speed", _SPEED]
        with redirect_stdout(StringIO()):
            albot.main(words, standalone_mode=False)
        with Image.open(png) as drawn:
            small = drawn.convert("RGB")
            small.thumbnail((_WIDTH, 4 * _WIDTH), Image.Resampling.LANCZOS)
        if shot.clip is not None:
            with atomic_write(folder / shot.clip) as stream:
                stream.write((Path(place) / "shot.mp4").read_bytes())
    with atomic_write(folder / shot.file) as stream:
        small.quantize(_COLOURS).save(stream, "PNG", optimize=True)


def draw_all(again: bool, chosen: str) -> list[str]:
    """Draw the pictures that there are not yet, and return the names of those that could not be.

    Args:
        again: Whether to draw all anew.
        chosen: Draw only those whose file has this in its name.
    """
    FOLDER.mkdir(exist_ok=True)
    refused = []
    wanted = [shot for shot in shots() if chosen in shot.file]
    with progress("gallery", len(wanted), "pictures") as done:
        for number, shot in enumerate(wanted):
            done(number)
            if again or not (FOLDER / shot.file).exists():
                try:
                    draw(shot)
                except InputError as error:
                    refused.append(f"{shot.name}: {error}")
    return refused


def gallery_page() -> str:
    """Return the page of all pictures and clips, each with its command; those drawn are shown."""
    parts = [
        "# Gallery\n",
        "Each mapper, task, agent and kind of world, with the command that draws it; clips are "
        "40 times faster than real time (`--video FILE --speed 40`). "
        "`python -m albot_site gallery` draws all in some minutes, in a clone of the repository; "
        "pictures that are not drawn yet are missing here.\n",
    ]
    group = ""
    for shot in shots():
        if shot.group != group:
            group = shot.group
            parts.append(f"## {group}\n")
        parts += [f"### {shot.name}\n", f"{shot.text}\n", f"`{shot.command}`\n"]
        if (FOLDER / shot.file).exists():
            parts.append(f"![{shot.name}](gallery/{shot.file}){{ loading=lazy }}\n")
        if shot.clip is not None and (FOLDER / shot.clip).exists():
            parts.append(
                f'<video src="gallery/{shot.clip}" controls loop muted preload="none" '
                f'aria-label="{shot.name}" style="max-width: 100%"></video>\n'
            )
    return "\n".join(parts)
