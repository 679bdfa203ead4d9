"""What all tasks share: batched robots, their observations, actions, statistics and starts."""
