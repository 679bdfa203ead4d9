"""Agents in many worlds, watched at every step, in processes of their own."""
