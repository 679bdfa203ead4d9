"""`Albot/Explore-v0`: cover an unknown building."""
