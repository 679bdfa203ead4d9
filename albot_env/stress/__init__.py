"""What must hold after every step of an episode, checked from outside."""
