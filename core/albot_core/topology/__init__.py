"""Networks of places: what mapping systems that know places have in common."""
