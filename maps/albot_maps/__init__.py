"""Worlds: floor plans, readers of foreign formats and a catalogue of hand-drawn buildings."""
