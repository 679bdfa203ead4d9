"""The simulator, its sensors, the gymnasium environments, recording and rendering."""
