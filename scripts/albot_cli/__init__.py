"""The `albot` command: one subcommand a file."""
