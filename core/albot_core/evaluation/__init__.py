"""Errors of trajectories, quality of maps, precision and recall of place recognition."""
