"""Trajectory errors, map quality, precision and recall of place recognition."""
