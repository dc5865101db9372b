"""Friction followed over time (wear), material (batch) and one stroke (signature)."""
