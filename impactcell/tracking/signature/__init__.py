"""Friction along one stroke, and whether a cycle is like the others of its material."""
