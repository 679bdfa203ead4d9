"""Judgements of relative direction, before and after disorientation (Waller and Hodgson 2006)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from albot_experiments.pointing_drawing import draw_bars
from albot_experiments.pointing_errors import (
    MARGIN,
    Effect,
    changes,
    configuration_error,
    jrd_errors,
    rises,
    told,
    triads_of,
)
from albot_experiments.pointing_lessons import CLOSED, TURNED, TURNS, Lesson, teach
from albot_experiments.pointing_scenes import chamber
from albot_experiments.pointing_subjects import (
    EGOCENTRIC,
    MAPPERS,
    SUBJECTS,
    SWITCH,
    Memories,
    memories_of,
)
from albot_experiments.probe_pointing import CONDITIONS as POINTING_CONDITIONS
from albot_experiments.probe_pointing import Answers as Pointing
from albot_experiments.report import Figures, Report, each_seed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "probe-jrd"
TITLE = "Judgements of relative direction and disorientation (Waller and Hodgson 2006)"
RISE, STAY, ORDER = "pointing rises", "judgements stay", "judgements err more"
RESULTS = RISE, STAY, ORDER
"""The results of the study that a subject can predict."""
PAPER: Mapping[str, Figures] = {RISE: True, STAY: True, ORDER: True, "judgements fall": True}
"""What the thesis says (section 2.1.2): judgements' errors "decreased after disorientation", which
is more than that they stay; the rest is the study's switch from "more accurate, transient" to "less
precise, enduring" memory. It gives no numbers. Its further sentence, that judgements' errors
"increased significantly more than the egocentric pointing errors", contradicts the first; we take
it for what it is to show, that judgements err more."""
JUDGED = (SWITCH, EGOCENTRIC, *MAPPERS)
"""The subjects that get verdicts."""
CONDITIONS = {
    **POINTING_CONDITIONS,
    "environment": (
        "a square chamber with six objects around it",
        "a chamber of 2.4 m in a hall of 8 m, six posts around it",
    ),
}


@dataclass(frozen=True, kw_only=True)
class Answers:
    """The measures of one subject in all lessons in which it knew at least three targets (rad)."""

    pointing: Pointing = field(default_factory=Pointing)
    """Its egocentric pointing."""
    judging: Mapping[str, list[float]] = field(
        default_factory=lambda: {CLOSED: [], TURNED: []},
    )
    """Variable errors of its judgements by phase, one per lesson."""

    def add(self, lesson: Lesson, memories: Memories) -> None:
        """Let the subject point and judge at the end of the phases of a lesson."""
        if memories[CLOSED].is_known.sum() < 3:
            return
        self.pointing.add(lesson, memories)
        for phase, errors in self.judging.items():
            memory = memories[phase]
            triads = triads_of(memory.is_known)
            errors.append(configuration_error(jrd_errors(memory.places, lesson.targets, triads)))

    @property
    def change(self) -> Effect | None:
        """What disorientation adds to the judgements' variable error, within subjects."""
        return Effect.of(changes(self.judging[CLOSED], self.judging[TURNED]))

    @property
    def difference(self) -> Effect | None:
        """How much more judgements err than pointing before disorientation, within subjects."""
        return Effect.of(changes(self.pointing.configuration[CLOSED], self.judging[CLOSED]))

    def predicts(self, result: str) -> bool:
        """Return whether the subject shows a result of the study, one of `RESULTS`."""
        if not self.pointing.is_tested:
            return False
        if result == RISE:
            return rises(self.pointing.change)
        if result == STAY:
            return self.change is not None and self.change.high < MARGIN
        return rises(self.difference)

    @property
    def falls(self) -> bool:
        """Whether the judgements' error falls, as people's did."""
        return self.pointing.is_tested and self.change is not None and self.change.high < -MARGIN

    def figures(self) -> dict[str, Figures]:
        """Return its row of the table."""
        pointing = self.pointing.configuration
        return {
            "lessons": len(pointing[CLOSED]),
            f"pointing, {CLOSED}": told(Effect.of(pointing[CLOSED])),
            f"pointing, {TURNED}": told(Effect.of(pointing[TURNED])),
            "pointing, change": told(self.pointing.change),
            f"judging, {CLOSED}": told(Effect.of(self.judging[CLOSED])),
            f"judging, {TURNED}": told(Effect.of(self.judging[TURNED])),
            "judging, change": told(self.change),
            "judging less pointing": told(self.difference),
            **{result: self.predicts(result) for result in RESULTS},
            "judgements fall": self.falls,
        }


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Teach the objects once per seed; let all subjects point and judge.

    Raises:
        InputError: No seeds.
    """
    scene = chamber()
    asked = {name: Answers() for name in SUBJECTS}
    for seed in each_seed(seeds, progress):
        lesson = teach(scene, seed)
        for name, memories in memories_of(lesson, seed, SUBJECTS).items():
            asked[name].add(lesson, memories)
    return report(asked, seeds)


def report(asked: Mapping[str, Answers], seeds: range) -> Report:
    """Return the report of the answers by subject."""
    paper_s = asked[SWITCH]
    measured: dict[str, Figures] = {result: paper_s.predicts(result) for result in RESULTS}
    measured["judgements fall"] = paper_s.falls
    measured |= {name: answers.figures() for name, answers in asked.items()}
    measured["seeds"] = len(seeds)
    verdicts = {
        f"{name} {result}": asked[name].predicts(result) for name in JUDGED for result in RESULTS
    }
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=all(verdicts[f"{SWITCH} {result}"] for result in RESULTS),
        verdicts=verdicts,
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"judgements": _picture(asked)},
    )


def _text(seeds: range) -> str:
    return f"""
After D. Waller and E. Hodgson, *Transient and enduring spatial representations under disorientation
and self-rotation*, Journal of Experimental Psychology: Learning, Memory, and Cognition 32, 2006, as
given in the thesis (section 2.1.2). Once for each of the seeds {seeds.start} to {seeds.stop - 1} a
robot is shown six objects around a chamber, as in `probe-pointing`, and asked twice without sight:
after a brief turn, and after {TURNS} turns or more in which its wheels slip. It points to each
object from where it is, and it judges all 120 relative directions: stand at A, face B, point to C.
How a target is remembered, and what the models are, is told in
[docs/probes.md](../../probes.md).

All errors are variable errors, the standard deviation of signed errors around their mean, as in the
study's figure; means over lessons in degrees, with bootstrapped 95 % intervals. A change or a
difference is within subjects. A lesson in which a subject knew fewer than three targets is left
out.

- `{RISE}`: disorientation adds more than {MARGIN:g}° to the error of pointing.
- `{STAY}`: it adds less than {MARGIN:g}° to that of judgements. In people it even fell, which is
  told beside it and not asked for.
- `{ORDER}`: before disorientation, judgements err by {MARGIN:g}° more than pointing.

Each is asked of the whole interval, and the test must be valid for the subject as in
`probe-pointing`. The experiment is reached where the study's own explanation, `{SWITCH}`, predicts
all three. The paper column has the direction of each result, the measured one that of `{SWITCH}`.
"""


def _picture(asked: Mapping[str, Answers]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.8), layout="constrained")
    pointing, judging = figure.subplots(1, 2, sharex=True)
    measures = {
        "egocentric pointing": {name: each.pointing.configuration for name, each in asked.items()},
        "judgements of relative direction": {name: each.judging for name, each in asked.items()},
    }
    for axes, (title, errors) in zip((pointing, judging), measures.items(), strict=True):
        draw_bars(
            axes,
            {
                phase: {name: Effect.of(each[phase]) for name, each in errors.items()}
                for phase in (CLOSED, TURNED)
            },
        )
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("variable error (°)")
    judging.legend(loc="lower right", fontsize=8)
    return figure
