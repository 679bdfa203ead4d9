"""Checks that must hold after every step of an episode, independent of the simulator."""
