"""Readers of world files, a format a file, and the writer of our own."""
