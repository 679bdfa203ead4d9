"""Training: agents that learn by reinforcement, by runs that can be killed and resumed."""
