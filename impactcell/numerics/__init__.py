"""Numerical building blocks that know nothing of taps: compilation, polynomials, small matrices."""
