"""Episodes for other programs: as data sets for offline learning, and for viewers."""
