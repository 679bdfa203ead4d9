"""The layers that a map can have."""
