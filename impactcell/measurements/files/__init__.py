"""Files of every kind as tables: text in any dialect, and what recorders and other programs write."""
