"""A set of shots fitted by the plant: predictions, least squares, derivatives, intervals."""
