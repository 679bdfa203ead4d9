"""Trained agents: their files and how they act. The project's trained agents lie here."""
