"""What the effects and the findings of the discrepancy workflow are called in German, for page and report."""
