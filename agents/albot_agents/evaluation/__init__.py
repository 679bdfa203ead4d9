"""Evaluate agents: episodes in parallel; success and path lengths with confidence intervals."""
