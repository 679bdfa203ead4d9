"""Albot0's cognitive map: absolute space representations (ASRs) from sonar, and the way home.

`mapper` is the mapper; docs/albot0.md describes the system.
"""
