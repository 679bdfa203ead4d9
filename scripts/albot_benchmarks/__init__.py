"""Speed benchmarks; each part is timed beside a baseline in the same minute."""
