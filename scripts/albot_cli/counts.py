"""Counts as text."""

from albot_core.counts import many as many
