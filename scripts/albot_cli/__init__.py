"""The `albot` command: one module per subcommand."""
