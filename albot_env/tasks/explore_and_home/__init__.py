"""`Albot/ExploreAndHome-v0`: explore, and be home before the time is up."""
