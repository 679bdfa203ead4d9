"""The schema of Albot0's state, except its trail."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.albot0.geometric_map import GeometricMap
from albot_core.mappers.albot0.paths import FARTHEST, SAMPLE
from albot_core.mappers.albot0.steps import ECHOES, Steps, join_steps
from albot_core.mappers.schema import (
    LONGEST,
    Arrays,
    Field,
    Pack,
    Schema,
    Sizes,
    generator,
    refuse_unless,
)

_SHORTEST = 1e-6
"""Minimum length of a step (m)."""
_FAR = 2 * LONGEST
"""Maximum distance of an echo (m)."""
STEPS = tuple(Steps.__dataclass_fields__)
"""The names of the arrays of steps."""


def steps_of(state: Arrays, name: str) -> Steps:
    """Return the steps of the way `out` or `home` in a state (copies)."""
    return Steps(**{field: state[f"{name}.{field}"].copy() for field in STEPS})


def all_steps(state: Arrays) -> Steps:
    """Return all steps in a state (copies)."""
    return join_steps(steps_of(state, "out"), steps_of(state, "home"))


def step_fields(name: str) -> tuple[Field, ...]:
    """Return the fields of the way `out` or `home`."""
    long = _SHORTEST, LONGEST
    return (
        Field(f"{name}.lines", f"{name} 4", at=None, lengths=long, least=-FARTHEST, most=FARTHEST),
        Field(f"{name}.widths", f"{name} 2", at=None, least=0, most=LONGEST),
        Field(f"{name}.walled", f"{name} 2", bool, at=None),
        Field(f"{name}.begins", name, bool, at=None),
        Field(f"{name}.readings", name, int, at=None, least=0, below="readings", rising=True),
        Field(f"{name}.echoes", f"{name} {ECHOES} 2", at=None, least=-_FAR, most=_FAR),
    )


def _check_path(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the samples of the robot path in progress are valid."""
    samples, readings = state["path.samples"], sizes["readings"]
    refuse_unless(sizes["before"] <= 1, "path.before", "one heading at most", sizes["before"])
    heard, reach, number = samples[:, 6:8], samples[:, 8], samples[:, 9]
    is_right = np.isin(heard, (0.0, 1.0)).all() and (reach > 0).all()
    in_order = (number >= 0).all() and (number < readings).all() and (np.diff(number) >= 0).all()
    refuse_unless(is_right and in_order, "path.samples", f"samples of {readings} readings")


def _check_ways(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless there is ground beside all steps, and a way out before one home."""
    for name in ("out.widths", "home.widths"):
        is_right = (state[name].sum(axis=1) >= _SHORTEST).all()
        refuse_unless(is_right, name, "some ground beside each step", "none")
    refuse_unless(
        sizes["is_returning"] or not sizes["home"],
        "home.lines",
        "none before the robot turned round",
        "some",
    )


def _check_beliefs(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the beliefs are about the ASRs of the way out."""
    total, regions = state["weights"].sum(), 0
    refuse_unless(abs(total - 1.0) <= 1e-6, "weights", "shares that sum to 1", total)
    if sizes["is_returning"]:
        out = GeometricMap(sizes["region_config"])
        out.extend(steps_of(state, "out"))
        regions = out.regions.count
        refuse_unless(regions > 0, "out.lines", "a way out before the way home", "none")
    expected = f"one for each of {regions} ASRs"
    refuse_unless(sizes["asrs"] == regions, "confidences", expected, sizes["asrs"])
    beliefs = state["beliefs"]
    are_due = (len(beliefs) > 0) == (regions > 0)
    refuse_unless(are_due, "beliefs", "some on the way home only", len(beliefs))
    is_right = (
        (beliefs[:, 1:3] < regions).all()
        and (beliefs[:, 0] < max(sizes["readings"], 1)).all()
        and (np.diff(beliefs[:, 0]) >= 0).all()
    )
    refuse_unless(is_right, "beliefs", f"beliefs about {regions} ASRs, in order")


SCHEMA = Schema(
    Field("pose", "3"),
    Pack(
        "counts",
        int,
        Field("readings", least=0),
        Field("updates", least=0),
        Field("is_returning", least=0, most=2),
        Field("time", least=0),
        at=None,
    ),
    Field("path.samples", f"samples {SAMPLE}", at=None),
    Pack(
        "path.numbers",
        float,
        Field("heading", at="_path.heading"),
        Field("travelled", at="_path.travelled"),
    ),
    Field("path.before", "before", at=None),
    *step_fields("out"),
    *step_fields("home"),
    generator("rng"),
    Field("weights", "cues", at="_fusion.weights", least=0),
    Field("confidences", "asrs"),
    Field("beliefs", "beliefs 4", int, at=None, least=(0, 0, -1, 0), most=(2**53,) * 3 + (1,)),
    Field("believed", "beliefs 3", at=None, least=-1.0),
    rules=(_check_path, _check_ways, _check_beliefs),
)
"""Rows of `beliefs` are a reading, a place, its rival, and whether the robot is sure; rows of
`believed` are the confidences of both places, and the probability that the frame was kept, -1 if
there is no trail."""
