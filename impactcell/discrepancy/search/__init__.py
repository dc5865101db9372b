"""Where a fitted model fails and which effect mends it: tests, candidates, selection, proof."""
