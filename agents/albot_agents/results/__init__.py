"""The table of results: every agent in buildings, and with odometers, that none was made in."""
