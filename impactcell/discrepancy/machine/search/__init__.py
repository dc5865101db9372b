"""Which term is missing, which others the records cannot tell from it, and what would explain as much."""
