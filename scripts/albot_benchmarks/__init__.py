"""How fast the parts are, each measured beside something run in the same minute."""
