"""Whole cycles of a module: which to read next, read so that none is a mixture, each taken once."""
