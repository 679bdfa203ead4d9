"""The tasks: one gymnasium environment a file, over shared observations, rewards and coverage."""
