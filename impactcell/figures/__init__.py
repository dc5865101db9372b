"""Figures of the source paper and of this project, drawn from this code."""
