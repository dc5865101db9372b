"""Records of a machine made fit for its equation of motion: equal steps, whole turns, held-out stretches."""
