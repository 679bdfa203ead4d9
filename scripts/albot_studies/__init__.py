"""Studies of the mappers whose figures stand in docs/: subcommands of `albot experiment study`."""
