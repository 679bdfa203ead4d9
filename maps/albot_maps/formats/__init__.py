"""Readers of world files, one module per format, and the writer of `albot-world` files."""
