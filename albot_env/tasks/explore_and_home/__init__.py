"""`Albot/ExploreAndHome-v0`: explore, and return home before the time is up."""
