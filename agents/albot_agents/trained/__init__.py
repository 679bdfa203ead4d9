"""Trained agents: their files, and how they act. The agents that ship lie here."""
