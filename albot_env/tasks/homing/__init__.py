"""`Albot/Homing-v0`: find the way home from an outward journey."""
