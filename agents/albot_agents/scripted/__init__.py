"""Agents whose behaviour is written, not learned."""
