"""What the server shows: nodes and their references, values, and objects made from types."""
