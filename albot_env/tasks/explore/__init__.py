"""`Albot/Explore-v0`: cover a building that was never seen before."""
