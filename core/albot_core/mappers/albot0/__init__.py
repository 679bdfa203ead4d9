"""Albot0's cognitive map: absolute space representations (ASRs) by sonar, and the way home by them.

See `mapper` for the robot, and docs/albot0.md for what it does.
"""
