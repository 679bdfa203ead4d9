"""`Albot/HomingByMap-v0`: find the way home by the map, in a building that may have changed."""
