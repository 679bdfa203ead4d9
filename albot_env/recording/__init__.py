"""Episodes as MCAP files: written as they run, read back, opened by Foxglove as they are.

- `episode`: an episode as data, and what a recorder is,
- `writer`, `reader`: the file,
- `messages`, `layers`: moments, and the layers of maps, as messages; `foxglove`: parts of these,
- `schemas`: the JSON Schema of each message.
"""
