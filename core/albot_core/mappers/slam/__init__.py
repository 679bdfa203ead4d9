"""Metric SLAM: several published systems, and the parts that they share."""
