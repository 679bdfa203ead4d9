"""`Albot/PlaceRecognition-v0`: say at each stop which earlier stop was at this place, if any."""
