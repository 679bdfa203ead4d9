"""The tasks: a folder each, and `core`, which they share.

Each folder has the same floor plan: `env` (the gymnasium environment; its docstring is the user's
documentation), `task` (the batched robots and their configuration), `reward` (what the reward's
terms are worth, and the compiled loop that works them out), and what only this task needs.
"""
