"""Localisation in a saved map: where the robot is, without a start pose.

- `known_map`: the map as walls, free ground and a likelihood field, made from a map's layers,
- `search`: all poses at which scans fit the map (branch and bound),
- `evidence`: how much a scan speaks for a pose,
- `localiser`: hypotheses weighed look by look, the decision between them, and tracking,
- `mapper`: a mapper that knows a saved map, and localises in it.
"""
