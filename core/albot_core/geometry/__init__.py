"""Poses, points and line segments in the plane. SI units, radians, REP-103 frames."""
