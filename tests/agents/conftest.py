"""The environment's fixtures serve here too."""

from tests.env.conftest import every_journey_is_made, make_env, two_rooms

__all__ = ["every_journey_is_made", "make_env", "two_rooms"]
