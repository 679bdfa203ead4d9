"""Batched environments for stable-baselines3, and how its threads wait."""

TRAINING_EXTRA = "in a clone of the project: pip install -c constraints.txt '.[train]'"
"""How to install what learners need."""
