"""The papers' experiments, one in each file, and the files that they share."""
