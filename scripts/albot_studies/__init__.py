"""Studies of the mappers for the figures in docs/: subcommands of `albot experiment study`."""
