"""What is told of an earlier arrival, by name."""

FEATURES = (
    "distance", "agreed", "contradicted", "sight", "shift", "turn", "matches", "share", "place",
    "recency", "way",
)  # fmt: skip
"""What an arrival is compared by, in the order of the numbers (see `arrivals.Notebook`)."""
