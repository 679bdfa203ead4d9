"""The papers' experiments: one a file, beside nothing but what they need."""
