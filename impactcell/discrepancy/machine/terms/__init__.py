"""What a base model of a machine may hold: its terms, laws beside them, and free forms in their places."""
