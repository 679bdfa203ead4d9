"""Episodes as MCAP files: written as they run, read back, opened by Foxglove as they are."""
