"""Real robots' logs, read; trajectories, surfaces and pictures of maps, written."""
