"""Files that other programs read: one function a layer and format."""
