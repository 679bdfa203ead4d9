"""Programs for developers, which try to break the project: `python -m albot_reliability`."""
