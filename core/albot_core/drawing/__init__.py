"""What all pictures share: colours, the place of labels, and how a figure is saved."""
