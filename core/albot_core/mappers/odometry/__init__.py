"""The map by odometry alone: every view laid down where the odometer says."""
