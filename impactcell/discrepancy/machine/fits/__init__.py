"""Models fitted to all blocks, how surely their numbers are known, what they leave, and the proof."""
