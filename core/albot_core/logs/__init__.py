"""Readers of real robots' logs, one module per format."""
