"""Sensor data: the `reading` at a step, and the `view` constructed from a laser scan."""
