"""How good a map is: measures of trajectories, of relations between poses, of surfaces."""
