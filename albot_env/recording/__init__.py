"""Episodes as MCAP files: written while they run, read back, and readable by Foxglove.

- `episode`: an episode as data, and the recorder interface,
- `writer`, `reader`: the file,
- `messages`, `layers`: moments and layers of maps as messages; `foxglove`: parts of messages,
- `schemas`: the JSON Schema of each message.
"""
