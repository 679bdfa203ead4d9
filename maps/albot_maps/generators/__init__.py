"""Random buildings: one kind per file, each drawn from a seed and a dataclass of parameters."""
