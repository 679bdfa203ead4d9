"""The perceptual map (chapter 3 of the thesis).

- `mapping`: algorithms 1 to 4, from top to bottom,
- `overlay`: the geometry of algorithm 3,
- `viewing`: taking a view from a scan,
- `memory`: the map and the view as arrays,
- `frames`: poses and surfaces in other frames.

What `albot1` uses in place of algorithms 1 and 2:

- `submap`: the walls in view and the remembered walls nearby, as rows to compare,
- `near_walls`: the expected walls that a wall in view may match,
- `submap_matching`: the robot's pose by all of these walls,
- `motion_search`: the likeliest motions between two views,
- `range_profile`: how well two views agree at each turn,
- `odometer_error`: the errors of the odometer, learnt from the matches,
- `consistency`: whether the robot was carried away.
"""
