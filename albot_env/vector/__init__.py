"""Batched environments for stable-baselines3, and the spin time of torch's threads."""

TRAINING_EXTRA = "in a clone of the project: pip install -c constraints.txt '.[train]'"
"""Command that installs the learners' dependencies."""
