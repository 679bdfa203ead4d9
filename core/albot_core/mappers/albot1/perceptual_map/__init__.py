"""The perceptual map (chapter 3 of the thesis).

- `mapping`: algorithms 1 to 4, from top to bottom,
- `overlay`: the geometry of algorithm 3,
- `viewing`: taking a view from a scan,
- `memory`: the map and the view as arrays,
- `frames`: poses and surfaces in other frames.

What `albot1` does in place of algorithms 1 and 2:

- `submap`: what is seen and what is remembered nearby, as rows to compare,
- `near_walls`: which of them a wall in view may be matched with,
- `submap_matching`: where the robot is by all of it,
- `motion_search`: the likeliest motions between two views,
- `range_profile`: how well two views agree at each turn,
- `odometer_error`: how far the odometer is off, learnt on the way,
- `consistency`: whether the robot was carried away.
"""
