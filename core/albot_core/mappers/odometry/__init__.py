"""The map by odometry alone: every view is placed at the odometer's pose."""
