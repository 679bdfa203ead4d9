"""`Albot/ExploreAndHome-v1`: explore, and return home before the time is up."""
