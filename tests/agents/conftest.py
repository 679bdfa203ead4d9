"""The environment's fixtures serve here too."""

from tests.env.conftest import make_env, two_rooms

__all__ = ["make_env", "two_rooms"]
