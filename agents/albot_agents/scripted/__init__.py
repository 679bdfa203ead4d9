"""Scripted agents: their behaviour is programmed, not learned."""
