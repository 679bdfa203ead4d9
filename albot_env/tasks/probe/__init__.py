"""`Albot/Probe-…-v0`: fixed scenes with a known answer, in which animals and people were tested."""
