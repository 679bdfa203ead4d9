"""Programs for developers that try to break the project: `python -m albot_reliability`."""
