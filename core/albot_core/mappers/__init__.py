"""The mapping systems, behind one interface.

- `mapper`: the interface of all mappers, and the capabilities of some,
- `registry`: the mappers by name; `map_file`: a mapper's memory as one file,
- `looped`: a batch of single mappers; `random_state`: a random generator as an array,
- a folder for each system, such as `albot1` and `odometry`.

docs/mappers.md shows step by step how to add a mapper.
"""
