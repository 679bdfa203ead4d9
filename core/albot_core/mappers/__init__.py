"""The mapping systems, behind one interface."""
