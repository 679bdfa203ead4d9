"""Golden digests: has a change of the code changed what comes out, and where?

    python -m albot_reliability digests write FILE [--part envs|logs|experiments]...
    python -m albot_reliability digests compare FILE [--part envs|logs|experiments]...

`write` runs environments, logs and experiments, and writes a digest of each result, by name;
`compare` runs them again and prints the names whose digests differ. Everything is run as users run
it, by gymnasium and by the `albot` command, so that code can be moved in between. Digests are exact
to the last bit: compare on the machine that wrote them.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import gymnasium
import numpy as np

# Importing it registers the environments.
import albot_env

# The only names that are not reached by gymnasium or the command: configurations of environments.
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_env.tasks.homing.task import HomingConfig

TASKS = ("Explore-v0", "Homing-v0", "HomingByMap-v0", "PlaceRecognition-v0", "ExploreAndHome-v1")
JOURNEYED = ("Homing-v0", "HomingByMap-v0", "PlaceRecognition-v0")
"""Tasks that begin with an outward journey, or tour."""
ENVIRONMENT_MAPPERS = ("none", "odometry", "albot1", "albot1-thesis")
LOG_MAPPERS = ("albot1", "albot1-thesis", "albot1-tracked", "odometry")
OFFICES = "random:office:0..9?rooms=6&people=2&boxes=2&doors=2"
OTHER_SENSORS = {
    "laser": "short",
    "sonar": "poor",
    "odometer": "carpet",
    "scenes": "ambiguous",
    "compass": "clouded",
}
KEPT = {"journeys": 2}
"""Number of outward journeys, or tours, that robots share; single environments make a new one each
time."""
LOGS: dict[str, tuple[str, ...]] = {
    "intel_raw.json.gz": (
        "--reference=intel_reference.json.gz",
        "--relations=intel.relations",
    ),
    "intel-corrected.log.gz": (),
    "aces-corrected.log.gz": (),
    "freiburg-101-corrected.log.gz": (),
    "wean_robotdata1.log.xz": (),
    "wean_robotdata2.log.xz": (),
    "duke_loop5.log.xz": (),
}
"""The logs and their options of ground truth, by the logs' file names."""
VARYING = ("seconds", "scans_per_second", "files")
"""Figures of `albot map` that are no results: times, and the paths of its files."""
EXPERIMENT_SEEDS = 2
"""Number of seeds of an experiment."""
ROBOTS = 6
"""Number of robots in a batch."""
STEPS = 800
"""Number of steps after a manual reset, of which each environment has two…"""
ARRIVALS = 30
"""…and the number in tasks in which a step is an arrival of a tour."""
LIMIT = 500
"""Number of steps after which an episode is truncated, so that some begin automatically."""
SPELL = 12
"""Number of steps for which a robot drives in the same way."""
SEED = 7


class Digests:
    """Digests by name, each of all values that were added to it, in their order."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}

    def add(self, name: str, value: Any) -> None:
        """Add a value; the values of a mapping are added under separate names.

        A batch's masks (`_room` beside `room`) are added to the values that they belong to.
        """
        if isinstance(value, Mapping):
            for key, part in value.items():
                self.add(f"{name}/{key.removeprefix('_')}", part)
            return
        before = self.found.get(name, "")
        self.found[name] = hashlib.sha256(before.encode() + as_bytes(value)).hexdigest()

    def add_figures(self, name: str, figures: Mapping[str, Any]) -> None:
        """Add the figures that a command has printed, each under its name."""
        for key, figure in figures.items():
            self.add(f"{name}/{key}", json.dumps(figure))

    def add_files(self, name: str, folder: Path) -> None:
        """Add the files of a folder, except pictures, each under its name."""
        for path in sorted(folder.iterdir()):
            if path.suffix != ".png":
                self.add(f"{name}/{path.name}", path.read_bytes())


def as_bytes(value: Any) -> bytes:
    """Return a value as bytes; for numbers these include dtype, shape and content."""
    if value is None or isinstance(value, str):
        return str(value).encode()
    if isinstance(value, bytes):
        return value
    if isinstance(value, Mapping):
        return b"".join(key.encode() + as_bytes(part) for key, part in value.items())
    array = np.asarray(value)
    if array.dtype.kind in "OU":
        content = b"\n".join(as_bytes(part) for part in array.ravel().tolist())
        return f"{array.shape}".encode() + content
    return f"{array.dtype}{array.shape}".encode() + array.tobytes()


@dataclass(frozen=True, kw_only=True)
class Run:
    """An environment, and how it is driven."""

    name: str
    task: str
    robots: int | None
    """Number of robots in a batch; None for a single environment."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """The arguments with which the environment is made."""
    says: float = 0.002
    """Probability that in a step the action's third number declares or claims something."""


def environment_runs() -> Iterator[Run]:
    """Yield all environments, single and batched, with all mappers, and some with other sensors."""
    for task in TASKS:
        kept: dict[str, Any] = KEPT if task in JOURNEYED else {}
        if task == "Explore-v0":
            kept = {"config": ExploreConfig(claims=False)}
        for mapper in ENVIRONMENT_MAPPERS:
            single = {"mapper": mapper, "observation": "dict"}
            if "config" in kept:
                single |= kept
            yield Run(name=f"{task}/{mapper}/single", task=task, robots=None, settings=single)
            batch = {"mapper": mapper} | kept
            yield Run(name=f"{task}/{mapper}/batch", task=task, robots=ROBOTS, settings=batch)
        offices = {"world": OFFICES, "threads": 2} | kept
        yield Run(name=f"{task}/albot1/offices", task=task, robots=ROBOTS, settings=offices)
        seen = {"observation": "dict", "autoreset_mode": "SameStep"} | kept | OTHER_SENSORS
        if task != "PlaceRecognition-v0":
            seen["action"] = "discrete"
        yield Run(name=f"{task}/albot1/sensors", task=task, robots=ROBOTS, settings=seen)
    for task, config, says in (
        ("Explore-v0", ExploreConfig(), 0.2),
        ("Homing-v0", HomingConfig(radius=20.0), 0.005),
        (
            "ExploreAndHome-v1",
            ExploreAndHomeConfig(shortest=10, longest=25, radius=20.0, ground=10.0),
            0.004,
        ),
    ):
        kept = KEPT if task == "Homing-v0" else {}
        for form, robots in (("single", None), ("batch", ROBOTS)):
            name, settings = f"{task}/albot1/configured-{form}", {"config": config} | kept
            yield Run(name=name, task=task, robots=robots, settings=settings, says=says)


def environments(digests: Digests, _: Path) -> None:
    """Drive all environments; digest observations, rewards, ends and infos, each separately."""
    for run in environment_runs():
        with_progress(f"envs/{run.name}", drive, run, digests)


def drive(run: Run, digests: Digests) -> None:
    """Drive one environment, or a batch, through two manual resets."""
    name, task = f"envs/{run.name}", f"Albot/{run.task}"
    settings: dict[str, Any] = {"max_episode_steps": LIMIT, **run.settings}
    robots = run.robots or 1
    made: Any
    if run.robots is None:
        made = gymnasium.make(task, **settings)
        space = made.action_space
    else:
        made = gymnasium.make_vec(task, num_envs=robots, **({"threads": 1} | settings))
        space = made.single_action_space

    def begin(seed: int | None) -> None:
        observation, info = made.reset(seed=seed)
        digests.add(f"{name}/observation", observation)
        digests.add(f"{name}/info", info)

    steps = ARRIVALS if run.task == "PlaceRecognition-v0" else STEPS
    rng = np.random.default_rng(SEED)
    for seed in (SEED, None):
        begin(seed)
        for action in draw_actions(rng, space, (steps, robots), run.says):
            observation, reward, terminated, truncated, info = made.step(
                action[0] if run.robots is None else action
            )
            digests.add(f"{name}/observation", observation)
            digests.add(f"{name}/reward", reward)
            digests.add(f"{name}/terminated", terminated)
            digests.add(f"{name}/truncated", truncated)
            digests.add(f"{name}/info", info)
            if run.robots is None and (terminated or truncated):
                begin(None)
    made.close()


def draw_actions(
    rng: np.random.Generator, space: Any, shape: tuple[int, int], says: float
) -> np.ndarray:
    """Return actions for a number of steps and robots, drawn independently of their effects.

    Robots drive in wide curves for a spell, and sometimes backwards in a narrow one. Of discrete
    actions the first ones, which drive forward, are the likelier.
    """
    if isinstance(space, gymnasium.spaces.Discrete):
        return np.asarray(space.n * rng.random(shape) ** 2, np.int64)
    spells = (-(-shape[0] // SPELL), shape[1])
    back = rng.random(spells) < 0.25
    speeds = np.where(back, -0.3, rng.uniform(0.4, 1.0, spells))
    turns = rng.uniform(-1.0, 1.0, spells) * np.where(back, 0.8, 0.2)
    numbers = np.full((*shape, *space.shape), -1.0, np.float32)
    numbers[..., 0] = np.repeat(speeds, SPELL, axis=0)[: shape[0]]
    numbers[..., 1] = np.repeat(turns, SPELL, axis=0)[: shape[0]]
    if space.shape[0] > 2:
        numbers[..., 2] = np.where(rng.random(shape) < says, 1.0, -1.0)
    return numbers


def logs(digests: Digests, data: Path) -> None:
    """Run the mappers on the logs; add their figures and files to the digests."""
    for log in LOGS:
        for mapper in LOG_MAPPERS:
            with_progress(f"logs/{log}/{mapper}", map_log, log, mapper, data / "logs", digests)


def map_log(log: str, mapper: str, folder: Path, digests: Digests) -> None:
    """Run one mapper on one log."""
    known = [option.replace("=", f"={folder}{os.sep}") for option in LOGS[log]]
    name = f"logs/{log}/{mapper}"
    with tempfile.TemporaryDirectory() as out:
        figures = albot("map", str(folder / log), "--mapper", mapper, "--out", out, *known)
        digests.add_files(f"{name}/files", Path(out))
    kept = {key: figure for key, figure in figures.items() if key not in VARYING}
    digests.add_figures(name, kept)


def experiments(digests: Digests, data: Path) -> None:
    """Repeat the experiments; add their figures and files to the digests."""
    for entry in albot("experiment", "list")["experiments"]:
        name = entry["id"]
        with_progress(f"experiments/{name}", repeat, name, data, digests)


def repeat(experiment: str, data: Path, digests: Digests) -> None:
    """Repeat one experiment."""
    name = f"experiments/{experiment}"
    seeds = f"1000..{999 + EXPERIMENT_SEEDS}"
    with tempfile.TemporaryDirectory() as out:
        report = albot("experiment", "run", experiment, "--seeds", seeds, "--out", out, data=data)
        digests.add_files(f"{name}/files", Path(out))
    digests.add_figures(f"{name}/measured", report["measured"])
    digests.add(f"{name}/holds", report["holds"])


def albot(*arguments: str, data: Path | None = None) -> dict[str, Any]:
    """Return the JSON output of the command.

    Raises:
        click.ClickException: The command fails.
    """
    command = Path(sys.executable).with_name("albot")
    around = os.environ | ({} if data is None else {"ALBOT_DATA": str(data)})
    done = subprocess.run(
        [command, *arguments, "--json"], capture_output=True, text=True, env=around, check=False
    )
    if done.returncode:
        failure = f"albot {' '.join(arguments)}: status {done.returncode}\n{done.stderr}"
        raise click.ClickException(failure)
    printed: dict[str, Any] = json.loads(done.stdout)
    return printed


def with_progress(name: str, run: Callable[..., None], *arguments: Any) -> None:
    """Run a function, and print its duration."""
    begin = time.perf_counter()
    run(*arguments)
    click.echo(f"{time.perf_counter() - begin:6.1f} s  {name}", err=True)


PARTS: dict[str, Callable[[Digests, Path], None]] = {
    "envs": environments,
    "logs": logs,
    "experiments": experiments,
}

_FILE = click.Path(path_type=Path)
_PART = click.option(
    "--part", "parts", multiple=True, type=click.Choice(list(PARTS)), help="Only this part."
)
_DATA = click.option(
    "--data",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    envvar="ALBOT_DATA",
    show_envvar=True,
    help="The folder with the real logs, for logs and experiments.",
)


@click.group()
def command() -> None:
    """Write digests of all that comes out, or compare with those written before."""


@command.command()
@click.argument("file", type=_FILE)
@_PART
@_DATA
def write(file: Path, parts: tuple[str, ...], data: Path | None) -> None:
    """Run, and write the digests to FILE, which keeps what it has of other parts."""
    chosen = parts or tuple(PARTS)
    kept = read_other(file, chosen) if file.exists() else {}
    found = run_parts(chosen, data)
    file.write_text(json.dumps(kept | found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    click.echo(f"{len(found)} digests written to {file}")


@command.command()
@click.argument("file", type=_FILE)
@_PART
@_DATA
def compare(file: Path, parts: tuple[str, ...], data: Path | None) -> None:
    """Run, and print what differs from FILE: exit status 1 if anything does."""
    chosen = parts or tuple(PARTS)
    golden = read_part(file, chosen)
    found = run_parts(chosen, data)
    differing = [name for name in golden | found if golden.get(name) != found.get(name)]
    for name in sorted(differing):
        word = "gone" if name not in found else "new" if name not in golden else "differs"
        click.echo(f"{word:7}  {name}")
    click.echo(f"{len(differing)} of {len(golden | found)} digests differ")
    sys.exit(1 if differing else 0)


def run_parts(parts: tuple[str, ...], data: Path | None) -> dict[str, str]:
    """Run parts, and return their digests by name."""
    if data is None and set(parts) != {"envs"}:
        raise click.UsageError("logs and experiments take --data, or ALBOT_DATA")
    click.echo(f"of {Path(albot_env.__file__).parent}", err=True)
    digests = Digests()
    for part in parts:
        with_progress(part, PARTS[part], digests, data or Path())
    return digests.found


def read_part(file: Path, parts: tuple[str, ...]) -> dict[str, str]:
    """Return the digests of some parts from a file."""
    every: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
    return {name: digest for name, digest in every.items() if name.split("/")[0] in parts}


def read_other(file: Path, parts: tuple[str, ...]) -> dict[str, str]:
    """Return the digests of all other parts from a file."""
    return read_part(file, tuple(part for part in PARTS if part not in parts))
