"""Agents that act in the environments: scripted and learned."""
