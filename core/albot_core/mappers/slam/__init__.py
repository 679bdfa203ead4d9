"""Metric SLAM: what its systems share, and the systems themselves, each as its source has it."""
