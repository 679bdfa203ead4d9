"""Comparing what is seen at two places."""
