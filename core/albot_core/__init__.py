"""Mapping, homing and evaluation algorithms for cognitive mapping robots.

Pure array code (numpy, numba, shapely): no physics and no reinforcement learning here.
"""
