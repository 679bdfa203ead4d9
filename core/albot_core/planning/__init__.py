"""Planning: where to go next, and how to drive there, by what a robot senses and believes."""
