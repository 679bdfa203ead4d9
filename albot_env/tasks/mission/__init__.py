"""`Albot/ExploreAndHome-v1`: explore, claim the places that come again, and be home in time."""
