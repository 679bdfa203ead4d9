"""Train agents by reinforcement learning, in runs that can be killed and resumed."""
