"""What must hold after every step of an episode, told from the outside."""
