"""Which values and events a client wants to be told of (Part 4, 7.7 and 7.22)."""
