"""Batched environments for stable-baselines3, and how its threads wait."""
