"""`Albot/PlaceRecognition-v0`: say of each place whether one has been there before, and when."""
