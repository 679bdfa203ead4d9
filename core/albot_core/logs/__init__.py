"""Readers of real robots' logs, a format a file."""
