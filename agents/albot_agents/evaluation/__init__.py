"""Agents measured: episodes in parallel, success and path lengths with their confidence."""
