"""The benchmark: a frozen protocol, a folder of measured episodes, and the page made of it."""
