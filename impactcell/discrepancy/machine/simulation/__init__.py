"""Models that run by themselves: how far they are off, and what simulating tells beside regression."""
