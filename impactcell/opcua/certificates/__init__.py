"""Certificates: made, kept in files, trusted, and when they end."""
