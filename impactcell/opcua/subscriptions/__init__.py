"""Subscriptions and their monitored items (Part 4, 5.13 and 5.14)."""
