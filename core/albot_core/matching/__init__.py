"""Place matching: lines, submaps or panoramas of two places, and where one lies in the other."""
