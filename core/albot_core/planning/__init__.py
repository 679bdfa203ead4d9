"""Planning: where to go next, and how to drive there, by what a robot senses and believes.

- `percept`: what a planner goes by at a step,
- `explorer`: from goal to goal; `gap_explorer`, `frontier_explorer`: how goals are chosen,
- `navigator`: to a given place, over ground that it maps as it goes,
- `occupancy_grid`, `grid_search`: the grid that they keep, and paths over it,
- `steering`: to a point near by, past what the laser sees.
"""
