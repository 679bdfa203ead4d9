"""Faults on purpose: what goes wrong with a robot's readings, and when.

- `span`: quantities with units, drawn anew at each strike,
- `fault`: a fault and the schedule of its strikes, which every fault has,
- `sensor_faults`, `odometer_faults`, `delivery_faults`: the faults of readings, one class each,
- `injector`: passes a robot's readings on, with the faults,
- `registry`: all of them by name, and their specs as text.

Faults of the world and of the robot's place in it are in `albot_env.faults`.
"""
