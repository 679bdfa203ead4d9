"""Random buildings: one kind a file, each from a seed and a dataclass of parameters."""
