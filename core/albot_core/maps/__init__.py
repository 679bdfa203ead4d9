"""Maps as data: the layers that a map can have, and the snapshot of a map."""
