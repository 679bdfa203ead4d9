"""Judgements along and across an intrinsic axis, by imagined heading (Mou and McNamara 2002)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.drawing.palette import BELIEVED, EXIT, HOME, PLACE, TRUTH, WALL
from albot_core.geometry.poses import wrap_angle
from albot_experiments.drawing import draw_floor, finish_maps
from albot_experiments.pointing_errors import Effect, Triads, jrd_errors, told, triads_of
from albot_experiments.pointing_lessons import COMPASS, ODOMETER, OPEN, Lesson, teach
from albot_experiments.pointing_scenes import SPACING, array
from albot_experiments.pointing_subjects import (
    ISOTROPIC,
    MAPPERS,
    SEEING,
    SUBJECTS,
    Memory,
    memories_of,
)
from albot_experiments.report import Figures, Report, each_seed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "probe-axes"
TITLE = "Imagined headings along and across an intrinsic axis (Mou and McNamara 2002)"
HEADINGS = tuple(range(0, 360, 45))
"""Imagined headings, counter-clockwise from the intrinsic axis (degrees)."""
VIEW = 315
"""The study view (degrees)."""
ALONG, ACROSS = "along", "across"
"""The lanes on which the array is learnt: along the axis 0°-180°, or across it."""
AXIS, ALIGNED, LEARNT = (
    "0° better than 315°",
    "aligned better than oblique",
    "learnt better than other axis",
)
"""Contrasts: of the intrinsic axis with the study view, of 90°, 180° and 270° with 45°, 135° and
225°, and (ours) of both directions of the learnt lanes with both across them."""
RESULTS = AXIS, ALIGNED
"""The results of the study that a subject can predict."""
PAPER: Mapping[str, Figures] = {AXIS: True, ALIGNED: True}
"""What the thesis says (section 2.1.3). It gives no numbers."""
JUDGED = MAPPERS
"""The subjects that get verdicts."""
LEAST_SHARE = 10.0
"""A contrast counts from this share of the subject's mean error on (%)."""
OWN_ERRORS = 2.0
"""A map has errors of its own if they are this many times those of seeing with true poses."""
CONDITIONS = {
    "environment": (
        "letters or disks in columns of one colour, on a mat in a room",
        "nine posts, eight of them around one in steps of 45°; a room of 10 m by 8 m",
    ),
    "subjects": ("people", "mappers, and models of spatial memory, on the same readings"),
    "learning": (
        "from one view at 315°, the objects named along the axis 0°-180°",
        "from the same view into the array, and twice through its lanes along that axis",
    ),
    "sensors": ("eyes", f"laser; odometer `{ODOMETER}`; compass `{COMPASS}`"),
    "questions": (
        "stand at A, face B, point to C, in another room",
        "the same, without own pose: A and B are the middle object and one around it",
    ),
}


@dataclass(frozen=True, kw_only=True)
class Answers:
    """The answers of one subject in all lessons in which it knew all targets."""

    errors: list[Float64[np.ndarray, "headings"]] = field(default_factory=list)
    """Mean absolute error by imagined heading (rad), one row per lesson."""
    left_out: list[bool] = field(default_factory=list)
    """Whether each lesson was left out, because a target was never seen."""

    def add(self, lesson: Lesson, memory: Memory) -> None:
        """Let the subject judge all questions of all headings."""
        self.left_out.append(not memory.is_known.all())
        if self.left_out[-1]:
            return
        means = [
            float(np.abs(jrd_errors(memory.places, lesson.targets, triads)).mean())
            for triads in questions(lesson.targets)
        ]
        self.errors.append(np.array(means))

    @property
    def mean(self) -> Effect | None:
        """The mean error over all headings."""
        return Effect.of([float(errors.mean()) for errors in self.errors])

    def contrast(
        self, worse: tuple[int, ...], better: tuple[int, ...], seeing: Answers
    ) -> Effect | None:
        """Return how much more some headings err than others by the map, within subjects.

        What comes from seeing, the same difference of `true-poses`, is taken off: a beam is as wide
        for all maps, and a lane passes some objects on both sides and others on one.

        Args:
            worse: Imagined headings (degrees).
            better: Other ones (degrees).
            seeing: The answers of `true-poses` in the same lessons.

        Returns:
            The difference as a share of the subject's mean error over all headings (%); 0 for one
            that never errs.
        """
        shares = []
        for errors, seen in zip(self.errors, seeing.errors, strict=True):
            mean = float(errors.mean())
            by_map = errors - seen
            apart = _mean_of(by_map, worse) - _mean_of(by_map, better)
            shares.append(np.radians(100.0 * apart / mean) if mean > 0.0 else 0.0)
        return Effect.of(shares)

    def contrasts(self, lanes: str, seeing: Answers) -> dict[str, Effect | None]:
        """Return the contrasts by name, for an array that was learnt on these lanes."""
        learnt, other = ((0, 180), (90, 270)) if lanes == ALONG else ((90, 270), (0, 180))
        return {
            AXIS: self.contrast((VIEW,), (0,), seeing),
            ALIGNED: self.contrast((45, 135, 225), (90, 180, 270), seeing),
            LEARNT: self.contrast(other, learnt, seeing),
        }

    def has_own_errors(self, seeing: Answers) -> bool:
        """Return whether the map errs clearly more than `true-poses`, given its answers."""
        if self.mean is None or seeing.mean is None:
            return False
        return self.mean.low > OWN_ERRORS * seeing.mean.mean

    def predicts(self, result: str, seeing: Answers) -> bool:
        """Return whether the map errs as people do: the whole interval of a contrast is so large.

        A map without errors of its own predicts nothing.

        Args:
            result: One of `RESULTS`.
            seeing: The answers of `true-poses`.
        """
        effect = self.contrasts(ALONG, seeing)[result]
        return self.has_own_errors(seeing) and effect is not None and effect.low > LEAST_SHARE

    def figures(self, lanes: str, seeing: Answers) -> dict[str, Figures]:
        """Return its row of the table of these lanes; `seeing` answers as `true-poses`."""
        by_heading = zip(
            HEADINGS, np.transpose(self.errors).reshape(len(HEADINGS), -1), strict=True
        )
        return {
            f"lessons, {lanes}": len(self.errors),
            "mean": told(self.mean),
            **{f"{heading}°": _mean_degrees(errors) for heading, errors in by_heading},
            "own errors": self.has_own_errors(seeing),
            **{f"{name} (%)": told(each) for name, each in self.contrasts(lanes, seeing).items()},
        }


Asked = Mapping[str, Mapping[str, Answers]]
"""The answers by lanes and by subject."""


def questions(targets: Float64[np.ndarray, "targets 2"]) -> list[Triads]:
    """Return the questions of each heading: from or to the middle object, which is the first.

    All their A and B are equally far apart, so that no heading is harder by the layout.
    """
    triads = triads_of(np.ones(len(targets), np.bool_))
    stand, face, _ = triads.T
    ahead = targets[face] - targets[stand]
    heading = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
    is_from_or_to_middle = (stand == 0) | (face == 0)
    return [
        triads[is_from_or_to_middle & (np.abs(_apart(heading, float(wanted))) < 1.0)]
        for wanted in HEADINGS
    ]


def _apart(heading: Float64[np.ndarray, "triads"], wanted: float) -> Float64[np.ndarray, "triads"]:
    return np.degrees(wrap_angle(np.radians(heading - wanted)))


def _mean_of(errors: Float64[np.ndarray, "headings"], headings: tuple[int, ...]) -> float:
    return float(np.mean([errors[HEADINGS.index(heading)] for heading in headings]))


def _mean_degrees(errors: Float64[np.ndarray, "lessons"]) -> float | None:
    return round(float(np.degrees(errors).mean()), 2) if len(errors) else None


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Teach the array once per seed and direction of lanes; let all subjects judge.

    Raises:
        InputError: No seeds.
    """
    asked = {lanes: {name: Answers() for name in SUBJECTS} for lanes in (ALONG, ACROSS)}
    for seed in each_seed(seeds, progress):
        for lanes, answers in asked.items():
            lesson = teach(array(across=lanes == ACROSS), seed)
            for name, memories in memories_of(lesson, seed, SUBJECTS).items():
                answers[name].add(lesson, memories[OPEN])
    return report(asked, seeds)


def report(asked: Asked, seeds: range) -> Report:
    """Return the report of the answers."""
    verdicts = {
        f"{name} {result}": asked[ALONG][name].predicts(result, asked[ALONG][SEEING])
        for name in JUDGED
        for result in RESULTS
    }
    measured: dict[str, Figures] = {
        result: any(verdicts[f"{name} {result}"] for name in JUDGED) for result in RESULTS
    }
    for lanes, answers in asked.items():
        for name, each in answers.items():
            measured[f"{name}, {lanes}"] = each.figures(lanes, answers[SEEING])
    measured["seeds"] = len(seeds)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=any(all(verdicts[f"{name} {result}"] for result in RESULTS) for name in JUDGED),
        verdicts=verdicts,
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"headings": _picture(asked)},
    )


def _text(seeds: range) -> str:
    return f"""
After W. Mou and T. P. McNamara, *Intrinsic frames of reference in spatial memory*, Journal of
Experimental Psychology: Learning, Memory, and Cognition 28, 2002, as given in the thesis (section
2.1.3). Once for each of the seeds {seeds.start} to {seeds.stop - 1} a robot looks at an array of
nine objects from 315°, is led twice through its lanes along the axis 0°-180°, and is shown each
object that it passes; in another lesson the lanes lead across. From its map alone it then judges
relative directions: stand at A, face B, point to C. A and B are the middle object and one of the
eight around it, {SPACING:g} m away, so that the layout makes no imagined heading harder than
another: `{ISOTROPIC}`, the truth with errors alike in all directions, shows what is left to chance.
How a target is remembered, and what the models are, is told in
[docs/probes.md](../../probes.md).

The columns 0° to 315° are the mean absolute errors of the imagined headings in degrees. The
contrasts are within subjects, as a share of the subject's mean error, with bootstrapped 95 %
intervals over lessons. The same difference of `{SEEING}`, which comes from seeing alone, is taken
off first; a subject that never errs has 0:

- `{AXIS}`: how much more 315°, the study view, errs than 0°, the intrinsic axis;
- `{ALIGNED}`: how much more 45°, 135° and 225° err than 90°, 180° and 270°;
- `{LEARNT}` (ours): how much more the headings across the lanes err than those along them.

A lesson in which a target was never seen is left out. A mapper predicts a result if the whole
interval of the contrast is above {LEAST_SHARE:g} % where the lanes lead along the axis, as people
learnt it, and if it has errors of its own: its mean error is {OWN_ERRORS:g} times that of
`{SEEING}`. The verdicts are of one such result each; the measured column tells whether any mapper
predicts it, and the experiment is reached where one mapper predicts both.
"""


DRAWN = {
    ISOTROPIC: WALL, SEEING: EXIT, "odometry": TRUTH, "albot1-thesis": BELIEVED, "ratslam": HOME,
    "sahabot": PLACE,
}  # fmt: skip
"""The subjects that are drawn, and their colours."""


def _picture(asked: Asked) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.6), layout="constrained")
    plan, *curves = figure.subplots(1, 3)
    scene = array()
    draw_floor(plan, scene.world.walls, WALL, 1.0, "walls, objects")
    plan.plot(*scene.tour.T, color=TRUTH, lw=0.8, label="lanes along 0°")
    plan.plot(*array(across=True).tour.T, color=BELIEVED, lw=0.8, ls="--", label="lanes across")
    plan.plot(*scene.tour[0], "o", color=HOME, ms=6, ls="none", label="study view, facing 315°")
    for axes, (lanes, answers) in zip(curves, asked.items(), strict=True):
        _draw_curves(axes, answers)
        axes.set_title(f"lanes {lanes} the axis", fontsize=10)
    curves[0].legend(loc="upper center", ncols=3, fontsize=8)
    finish_maps(figure)
    return figure


def _draw_curves(axes: Axes, answers: Mapping[str, Answers]) -> None:
    """Draw the error by imagined heading, in shares of each subject's mean."""
    for name, colour in DRAWN.items():
        rows = [errors / errors.mean() for errors in answers[name].errors if errors.mean() > 0]
        if rows:
            axes.plot(HEADINGS, np.mean(rows, axis=0), "o-", color=colour, ms=4, label=name)
    axes.set(
        xlabel="imagined heading (°)",
        ylabel="error by the subject's mean",
        xticks=HEADINGS,
        ylim=(0.6, 1.4),
    )
