"""How fast the parts are, each timed beside a baseline in the same minute."""
