"""The tasks: one folder each, and `core`, which they share.

All folders have the same layout: `env` (the gymnasium environment; its docstring is the user's
documentation), `task` (the batched robots and their configuration), `reward` (weights of the
reward's terms, and the compiled loop that computes them), and modules that only this task needs.
"""
