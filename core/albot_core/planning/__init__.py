"""Planning: where to go next and how to drive there, from sensor readings and estimated poses.

- `percept`: the input of a planner at a step,
- `explorer`: drives from goal to goal; `gap_explorer` and `frontier_explorer` choose the goals,
- `navigator`: drives to a given target, and maps the ground on the way,
- `occupancy_grid`, `grid_search`: the grid that they keep, and paths over it,
- `steering`: drives to a nearby point without touching what the laser sees.
"""
