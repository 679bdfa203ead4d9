"""The papers' experiments, one a file, and what they share."""
