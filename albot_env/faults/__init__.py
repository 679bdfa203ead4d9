"""Faults in environments: of readings (`albot_core.sensing.faults`), and of the world."""
