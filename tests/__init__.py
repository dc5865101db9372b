"""Tests, benchmarks and studies; each may be run as a module."""

import impactcell  # noqa: F401  # says how many threads numpy takes, and so comes before numpy
