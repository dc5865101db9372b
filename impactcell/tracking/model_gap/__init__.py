"""Whether the model still explains the captures."""
