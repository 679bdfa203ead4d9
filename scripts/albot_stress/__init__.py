"""Stress runs: agents in many worlds, with checks after every step."""
