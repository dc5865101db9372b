"""Laws of the effects, written apart from impactcell.physics, as the truth of tests."""
