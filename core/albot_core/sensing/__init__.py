"""What a robot senses at a step, before any mapper has made something of it."""
