"""Records cut into taps, each with its t = 0, its signs and its zero of force."""
