"""Three readings of the thesis, alone and together: their effects on Albot1's mappers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.logs.log import with_noise
from albot_core.mappers.albot1.config import Albot1Config
from albot_experiments.albot1_c1 import loop_from
from albot_experiments.albot1_c3 import second_lap, twice_round
from albot_experiments.albot1_e3 import DISTURBANCE, FLOORS, moved_by
from albot_experiments.albot1_e6 import thinned, wall_errors
from albot_experiments.albot1_places import place_tour
from albot_experiments.mapping import EVERY_READING, map_readings
from albot_experiments.real_logs import LOGS, read_real_log
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.revisiting import TOUR, WORLD, map_drive
from albot_experiments.tours import driven_tour, guided_tour, thinned_views
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-readings"
TITLE = "Three readings of the thesis (Hossain 2014, sections 3.1.4, 3.1.7 and 4.1.2)"
PAPER: dict[str, Figures] = {"readings": 3}
CONDITIONS = {
    "environment": ("–", "`office-ring` and the public logs"),
    "trials": ("–", "20 seeds; the thesis leaves these three readings open"),
}
PRESETS: Mapping[str, Callable[[], Albot1Config]] = {
    "albot1-thesis": Albot1Config.thesis,
    "albot1-tracked": Albot1Config.tracked,
    "albot1": Albot1Config,
}
READINGS = ("obstructing", "outer end kept", "covered")
"""An occluding point obstructs another surface; a surface that is extended keeps its outer end;
every surface that a view covers counts as observed again."""
LOG_COPIES = 4
"""Maximum number of copies of a log, with a little noise, that are mapped in addition to it."""
VARIANTS: Mapping[str, tuple[str, ...]] = {
    "none": (),
    **{f"{reading} alone": (reading,) for reading in READINGS},
    "all": READINGS,
}


@dataclass(kw_only=True)
class Tally:
    """The figures of one config, each with one value per seed."""

    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, name: str, value: float) -> None:
        """Add a value of a figure."""
        self.values.setdefault(name, []).append(value)

    def figures(self) -> dict[str, Figures]:
        """Return the medians of the figures; for shares the means."""
        medians: dict[str, Figures] = {}
        for name, values in self.values.items():
            middle = np.mean(values) if name.startswith("share_") else np.median(values)
            medians[name.removeprefix("share_")] = round(float(middle), 3)
        return medians


def config_of(preset: str, readings: tuple[str, ...]) -> Albot1Config:
    """Return a mapper's config with the given readings of the thesis, and none of the others."""
    config = PRESETS[preset]()
    return replace(
        config,
        view=replace(config.view, grazing_ends="obstructing" not in readings),
        keeps_outer_end="outer end kept" in readings,
        covered_is_reobserved="covered" in readings,
        view_spacing=EVERY_READING["view_spacing"],
        view_turn=EVERY_READING["view_turn"],
    )


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Run each preset with each variant on the floors and the logs, once per seed.

    Raises:
        InputError: No seeds, or no folder of real logs.
    """
    world = load_world(WORLD)
    tallies = {(preset, variant): Tally() for preset in PRESETS for variant in VARIANTS}
    configs = {
        (preset, variant): config_of(preset, readings)
        for preset in PRESETS
        for variant, readings in VARIANTS.items()
    }
    for seed in each_seed(seeds, progress):
        for measure in (_drive, _loop, _places):
            measure(world, seed, configs, tallies)
    for real in LOGS:
        known = read_real_log(real)
        reference = thinned(known.floor)
        logs = [known.log]
        if known.truth is not None:
            rngs = [np.random.default_rng(seed) for seed in seeds[:LOG_COPIES]]
            logs += [with_noise(known.log, rng) for rng in rngs]
        for key, config in configs.items():
            for log in logs:
                mapped = map_readings(key[0], log.readings, config=_chapter_3(config))
                believed = Trajectory(stamps=log.stamps, poses=mapped.poses)
                if known.truth is not None:
                    error = trajectory_error(believed, known.truth)
                    tallies[key].add(f"{real.name}_path_error_m", error.rmse if error else np.inf)
                else:
                    surfaces = mapped.mapper.snapshot().segments
                    walls = wall_errors(surfaces, known.frame_of(believed, surfaces), reference)
                    tallies[key].add(f"{real.name}_wall_precision", walls.precision)
    return _report(seeds, tallies)


_Key = tuple[str, str]
_Configs = Mapping[_Key, Albot1Config]
_Tallies = Mapping[_Key, Tally]

_chapter_3 = partial(replace, remembers_places=False)
"""Return a config without places."""


def _drive(world: World, seed: int, configs: _Configs, tallies: _Tallies) -> None:
    """Measure the drive of experiment 4."""
    ridden = driven_tour(world, world.tours[TOUR], np.random.default_rng(seed))
    journey = thinned_views(ridden, 0.1, np.radians(1.0))
    for key, config in configs.items():
        drive = map_drive(key[0], world, journey, _chapter_3(config))
        tallies[key].add("e4_path_error_m", drive.shape_after.path_error)
        tallies[key].add("e4_wall_precision", drive.shape_after.precision)
        if drive.corridor is not None:
            tallies[key].add("e4_corridor_length", drive.corridor)


def _loop(_: World, seed: int, configs: _Configs, tallies: _Tallies) -> None:
    """Measure the corridor of experiment 3, with a disturbed odometer."""
    floor = FLOORS["corridor"]
    world = load_world(floor.world)
    rng = np.random.default_rng(seed)
    journey = guided_tour(world, world.tours[floor.tour], rng, steps=floor.steps)
    disturbed = moved_by(journey, DISTURBANCE)
    for key, config in configs.items():
        drive = map_drive(key[0], world, disturbed, _chapter_3(config))
        tallies[key].add("e3_path_error_disturbed_m", drive.shape_after.path_error)


def _places(world: World, seed: int, configs: _Configs, tallies: _Tallies) -> None:
    """Measure the ring of chapter 4, from home once round, and twice round."""
    loop = world.tours["single-loop"]
    once = guided_tour(world, loop_from(loop, 0), np.random.default_rng(seed))
    twice = guided_tour(world, twice_round(loop), np.random.default_rng(seed))
    for key, config in configs.items():
        tally = tallies[key]
        tally.add("share_c1_right_from_S", place_tour(key[0], world, once, config).is_right(world))
        lap = second_lap(place_tour(key[0], world, twice, config))
        tally.add("share_c3_network_right", lap.placed.is_right(world))
        tally.add("share_c3_exits_predicted", float(np.isfinite(lap.aligned).mean()))


def _report(seeds: range, tallies: _Tallies) -> Report:
    groups: dict[str, Figures] = {
        f"{preset}, {variant}": tally.figures() for (preset, variant), tally in tallies.items()
    }
    letter = [tallies["albot1-thesis", variant].values for variant in ("none", "all")]
    none, together = (np.median(of["e4_path_error_m"]) for of in letter)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={"readings": len(READINGS), "seeds": len(seeds), **groups},
        holds=bool(together < none),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"readings": _picture(tallies)},
    )


def _text(seeds: range) -> str:
    return f"""
Three places of the thesis can be read in more ways than one. `albot1-thesis` reads all as follows:

- *obstructing*: an occluding point is an end that obstructs an edge of the next surface (section
  3.1.4), not any nearer end where a cluster breaks, as one wall seen at grazing incidence does;
- *outer end kept*: a remembered surface that is extended keeps its end outside the view (section
  3.1.7, figure 3.13), and is not laid along the new surface;
- *covered*: all surfaces that a view covers co-locate with it, and count for the place that they
  are of (section 4.1.2), not only those that the view holds too within 40 cm and 5°.

Each alone, none and all, in each of Albot1's mappers: on the drive of experiment 4, in the corridor
of experiment 3 with the disturbed odometer, in the network of chapter 4 (experiments 1 and 3), and
on the logs of experiment 6, with places left out as in chapter 3. Medians over the seeds
{seeds.start} to {seeds.stop - 1}, of shares the means; of a log whose path is known, over it and
{LOG_COPIES} copies with a little noise. Reached where all together better the letter's path on the
drive.

`albot1` keeps the first two: *obstructing* betters the corridor and ACES, *outer end kept* the
drive, Intel and the first log of Wean Hall. *Covered* changes nothing in it.
"""


def _picture(tallies: _Tallies) -> Figure:
    """Draw the path error on the drive by preset and variant."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.2), layout="constrained")
    axes = figure.subplots()
    for k, preset in enumerate(PRESETS):
        errors = [np.median(tallies[preset, of].values["e4_path_error_m"]) for of in VARIANTS]
        places = np.arange(len(VARIANTS)) + 0.27 * (k - 1)
        axes.bar(places, errors, 0.25, label=preset)
    axes.set_xticks(range(len(VARIANTS)), list(VARIANTS))
    axes.set(ylabel="path error on the drive of experiment 4 (m)", yscale="log")
    axes.legend()
    return figure
