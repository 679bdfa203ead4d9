"""The parts of observations.

Each is one object (`part.ObservationPart`): its name, shape and meaning, what it needs, and how its
numbers are decoded; beside it stands the compiled function that fills it in. `sensors` has those of
the latest reading, `beliefs` those of the mapper, `ground` those of the ground around the robot.
`observation_kernels` lists them in their order and fills them in.
"""
