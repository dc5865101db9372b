"""What recurs from cycle to cycle: `wear_batch`, `signature` along one stroke, and `model_gap`."""
