"""Compiled code: how functions are compiled, called and given their arguments."""
