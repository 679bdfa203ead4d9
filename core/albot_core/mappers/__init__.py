"""The mapping systems, behind one interface.

- `mapper`: what every mapper offers, and what only some offer more,
- `registry`: the mappers by name; `map_file`: a mapper's memory as one file,
- `looped`: a batch of mappers that know nothing of batches; `random_state`: a generator as arrays,
- a folder for each system: `albot1`, `odometry`.

docs/mappers.md adds one, step by step.
"""
