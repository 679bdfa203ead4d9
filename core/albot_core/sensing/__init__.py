"""What a robot senses at a step: `reading`, and the `view` that a laser scan becomes."""
