"""Exploration: where to go next, from what a robot senses and believes alone."""
