"""Pointing to objects and to corners before and after disorientation (Wang and Spelke 2000)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from albot_core.drawing.palette import BELIEVED, HOME, TRUTH, WALL
from albot_core.geometry.poses import transform_points
from albot_experiments.drawing import draw_floor, finish_maps
from albot_experiments.pointing_drawing import draw_bars
from albot_experiments.pointing_errors import (
    DISORIENTED_FROM,
    KNOWN_BELOW,
    MARGIN,
    Effect,
    changes,
    configuration_error,
    heading_error,
    pointing_errors,
    rises,
    stays,
    told,
)
from albot_experiments.pointing_lessons import (
    AGAIN,
    CLOSED,
    COMPASS,
    ODOMETER,
    OPEN,
    PHASES,
    TURNED,
    TURNS,
    Lesson,
    Scene,
    teach,
)
from albot_experiments.pointing_scenes import chamber, corner_room
from albot_experiments.pointing_subjects import (
    EGOCENTRIC,
    MAPPERS,
    SUBJECTS,
    Memories,
    Subject,
    memories_of,
)
from albot_experiments.report import Figures, Report, each_seed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "probe-pointing"
TITLE = "Pointing to objects and to corners before and after disorientation (Wang and Spelke 2000)"
OBJECTS, CORNERS = "objects", "corners"
SCENES: Mapping[str, Callable[[], Scene]] = {OBJECTS: chamber, CORNERS: corner_room}
PAPER: Mapping[str, Figures] = {"rises_for_objects": True, "rises_for_corners": False}
"""What the thesis says (section 2.1.1). It gives no numbers."""
JUDGED = (EGOCENTRIC, *MAPPERS)
"""The subjects that get verdicts."""
CONDITIONS = {
    "environment": (
        "a chamber with six objects around it; a rectangular room with its corners",
        "a chamber of 2.4 m in a hall of 8 m, six posts around it; a room of 6 m by 4 m",
    ),
    "subjects": ("people", "mappers, and models of spatial memory, on the same readings"),
    "sensors": ("eyes, own motion", f"laser; odometer `{ODOMETER}`; compass `{COMPASS}`"),
    "eyes closed": ("a brief rotation", "no beam returns; a turn of 90° to 180°"),
    "disoriented": (
        "an extensive rotation with closed eyes",
        f"{TURNS} turns or more, in which the wheels slip at random; the compass stands still",
    ),
}


@dataclass(frozen=True, kw_only=True)
class Answers:
    """The measures of one subject in all lessons in which it knew at least two targets (rad)."""

    configuration: Mapping[str, list[float]] = field(
        default_factory=lambda: {phase: [] for phase in PHASES}
    )
    """Configuration errors by phase, one per lesson."""
    heading: Mapping[str, list[float]] = field(
        default_factory=lambda: {phase: [] for phase in PHASES}
    )
    """Absolute heading errors, likewise."""
    lost: list[bool] = field(default_factory=list)
    """Whether the subject said that it was lost when it was disoriented, in all lessons."""

    def add(self, lesson: Lesson, memories: Memories) -> None:
        """Let the subject point at the end of each phase of a lesson."""
        self.lost.append(memories[TURNED].is_lost)
        if memories[OPEN].is_known.sum() < 2:
            return
        for phase, end in lesson.ends.items():
            memory = memories[phase]
            errors = pointing_errors(
                memory.pointed, memory.is_known, lesson.truth[end], lesson.targets
            )
            self.configuration[phase].append(configuration_error(errors))
            self.heading[phase].append(abs(heading_error(errors)))

    @property
    def change(self) -> Effect | None:
        """The change of the configuration error by disorientation, within subjects."""
        errors = self.configuration
        return Effect.of(changes(errors[CLOSED], errors[TURNED]))

    @property
    def is_tested(self) -> bool:
        """Whether it knew the targets, and was disoriented: else its answers say nothing."""
        knows = Effect.of(self.configuration[OPEN])
        turned = Effect.of(changes(self.heading[CLOSED], self.heading[TURNED]))
        if knows is None or turned is None:
            return False
        return knows.high < KNOWN_BELOW and turned.low > DISORIENTED_FROM

    @property
    def found_again(self) -> int:
        """In how many lessons the heading is right again after the look all round."""
        return int((np.degrees(self.heading[AGAIN]) < DISORIENTED_FROM).sum())

    def predicts(self, targets: str) -> bool:
        """Return whether it does as people do: errors rise for objects, and stay for corners."""
        people_do = rises if targets == OBJECTS else stays
        return self.is_tested and people_do(self.change)

    def figures(self, targets: str) -> dict[str, Figures]:
        """Return its row of the table of these targets."""
        return {
            "lessons": len(self.configuration[OPEN]),
            f"{targets}: {OPEN}": told(Effect.of(self.configuration[OPEN])),
            CLOSED: told(Effect.of(self.configuration[CLOSED])),
            TURNED: told(Effect.of(self.configuration[TURNED])),
            "change": told(self.change),
            f"heading, {CLOSED}": told(Effect.of(self.heading[CLOSED])),
            f"heading, {TURNED}": told(Effect.of(self.heading[TURNED])),
            "found again": f"{self.found_again} of {len(self.heading[AGAIN])}",
            "lost": f"{sum(self.lost)} of {len(self.lost)}",
            "as people": self.predicts(targets),
        }


Asked = Mapping[str, Mapping[str, Answers]]
"""The answers by targets and by subject."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Teach the targets once per seed, and let all subjects point.

    Raises:
        InputError: No seeds.
    """
    asked = {targets: {name: Answers() for name in SUBJECTS} for targets in SCENES}
    pictured = None
    for seed in each_seed(seeds, progress):
        for targets, answers in asked.items():
            scene = SCENES[targets]()
            lesson = teach(scene, seed)
            memories = ask(lesson, seed, SUBJECTS, answers)
            if pictured is None:
                pictured = scene, lesson, memories
    assert pictured is not None  # There is at least one seed.
    return report(asked, seeds, pictured)


def ask(
    lesson: Lesson, seed: int, subjects: Mapping[str, Subject], answers: Mapping[str, Answers]
) -> dict[str, Memories]:
    """Let subjects point in a lesson, add to their answers, and return their memories."""
    memories = memories_of(lesson, seed, subjects)
    for name, each in memories.items():
        answers[name].add(lesson, each)
    return memories


def report(
    asked: Asked,
    seeds: range,
    pictured: tuple[Scene, Lesson, Mapping[str, Memories]],
) -> Report:
    """Return the report of the answers; a scene, its lesson and memories are drawn."""
    measured: dict[str, Figures] = {
        f"rises_for_{targets}": rises(answers[EGOCENTRIC].change)
        for targets, answers in asked.items()
    }
    for targets, answers in asked.items():
        for name, each in answers.items():
            measured[f"{name}, {targets}"] = each.figures(targets)
    measured["seeds"] = len(seeds)
    verdicts = {
        f"{name} {targets}": asked[targets][name].predicts(targets)
        for name in JUDGED
        for targets in asked
    }
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts[f"{EGOCENTRIC} {OBJECTS}"],
        verdicts=verdicts,
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"pointing": _picture(asked, *pictured)},
    )


def _text(seeds: range) -> str:
    return f"""
After R. F. Wang and E. S. Spelke, *Updating egocentric representations in human navigation*,
Cognition 77, 2000, as given in the thesis (section 2.1.1). A robot is led round a chamber and is
shown six objects, and in another lesson the corners of a rectangular room; once for each of the
seeds {seeds.start} to {seeds.stop - 1}. From the middle it points to each target with open eyes,
after a brief turn without sight, after {TURNS} turns or more in which its wheels slip, and after a
look all round. All subjects get the same readings. How a target is remembered, and what the models
are, is told in [docs/probes.md](../../probes.md).

The configuration error is the standard deviation of the pointing errors over the targets around
their mean; the heading error is the size of that mean. All figures are means over lessons in
degrees, with bootstrapped 95 % intervals. `change` is what disorientation adds to the configuration
error, within subjects. `found again`: in how many lessons the heading error is below
{DISORIENTED_FROM:g}° after the look all round. `lost`: in how many the disoriented subject itself
said that it was lost; it points all the same. A lesson in which it knew fewer than two targets is
left out.

People's configuration error rises for objects and does not for corners. A subject does `as people`
where the interval of the change lies above {MARGIN:g}° (objects) or within {MARGIN:g}° of 0
(corners), if the test is valid for it: with open eyes its configuration error is below
{KNOWN_BELOW:g}° (chance: 104°), and disorientation adds more than {DISORIENTED_FROM:g}° to its
heading error. The verdicts are of one such result each. The experiment is reached where the paper's
own explanation, `{EGOCENTRIC}`, shows the rise for objects.
"""


def _picture(
    asked: Asked, scene: Scene, lesson: Lesson, memories: Mapping[str, Memories]
) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.6), layout="constrained")
    plan, *bars = figure.subplots(1, 3, width_ratios=(1.0, 1.25, 1.25))
    _draw_plan(plan, scene, lesson, memories)
    for axes, (targets, answers) in zip(bars, asked.items(), strict=True):
        draw_bars(
            axes,
            {
                phase: {name: Effect.of(a.configuration[phase]) for name, a in answers.items()}
                for phase in (CLOSED, TURNED)
            },
        )
        axes.set_title(targets, fontsize=10)
        axes.set_xlabel("configuration error (°)")
    bars[0].legend(loc="upper right", fontsize=8)
    finish_maps(figure)
    return figure


DRAWN = ("odometry", "albot1-thesis", EGOCENTRIC)
"""The subjects whose places are drawn."""


def _draw_plan(axes: Axes, scene: Scene, lesson: Lesson, memories: Mapping[str, Memories]) -> None:
    """Draw the scene, and where some subjects believe the targets, seen from the robot's pose."""
    draw_floor(axes, scene.world.walls, WALL, 1.0, "walls, objects")
    end = lesson.ends[OPEN]
    axes.plot(*lesson.truth[: end + 1, :2].T, color=WALL, lw=0.5, ls=":", label="tour")
    for name, colour, mark in zip(DRAWN, (TRUTH, BELIEVED, HOME), "ox^", strict=True):
        places = transform_points(lesson.truth[end], memories[name][OPEN].pointed)
        axes.plot(*places.T, mark, color=colour, ms=6, mfc="none", ls="none", label=name)
