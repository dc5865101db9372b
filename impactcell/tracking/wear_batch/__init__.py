"""Friction over time (wear) and over batches (material)."""
