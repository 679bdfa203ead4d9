"""What the fields of RatSLAM's state cannot express.

Compiled code follows the chains of links and transitions and checks no bounds. An invalid number
could make it access memory that is not its own, or run for ever.
"""

from __future__ import annotations

import numpy as np

from albot_core.mappers.schema import Arrays, Sizes, lead_out, refuse_unless


def _check_counts(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the robot sees a view and is in a place of this map."""
    experiences, readings = sizes["experiences"], sizes["history"]
    views = max(sizes.get(name, 0) for name in ("views", "templates", "scenes"))
    view, place, *_ = state["counts"].tolist()
    is_right = view < max(views, 1) and (place >= 0) == (experiences > 0)
    refuse_unless(is_right, "counts", "a view and a place of this map", (view, place))
    expected = f"{readings} at most, one a reading"
    refuse_unless(experiences <= readings, "experiences", expected, experiences)


def _check_templates(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless each experience of a laser has a view of its own, with its number."""
    if "templates" in sizes:
        count, numbers = sizes["experiences"], np.arange(sizes["experiences"])
        is_right = sizes["templates"] == count and (state["experiences.view"] == numbers).all()
        refuse_unless(is_right, "templates", f"one an experience, {count}", sizes["templates"])


def _check_tree(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless each experience but the first was reached from an older one."""
    reached_by = state["experiences.reached_by"][1:]
    numbers = np.arange(1, 1 + len(reached_by))
    is_right = (
        (reached_by >= 0)
        & (state["transitions.source"][reached_by] < numbers)
        & (state["transitions.target"][reached_by] == numbers)
        if len(reached_by) and sizes["transitions"]
        else reached_by >= 0
    )
    expected = "transitions that lead to each experience from an older one"
    refuse_unless(is_right.all(), "experiences.reached_by", expected)
    is_right = lead_out(state["experiences.onward"])
    refuse_unless(is_right, "experiences.onward", "ways that end", "one that runs in a circle")


RULES = (_check_counts, _check_templates, _check_tree)
