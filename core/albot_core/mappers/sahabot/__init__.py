"""Sahabot 2: an ant's path integration with a compass, landmarks, and a home vector.

Lambrinos and others, *A mobile robot employing insect strategies for navigation* (Robotics and
Autonomous Systems 30, 2000), as told in Hossain's thesis, section 2.3.1. Its third strategy, the
systematic search, is `albot_core.planning.systematic_search`.
"""
