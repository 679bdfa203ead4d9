"""Files for other programs: one function per layer and format."""
