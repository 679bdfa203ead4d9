"""Compiled code: how functions are compiled, called and given their arguments (docs/kernels.md)."""
