"""What the discrepancy workflow found, said in German, for page and report; an effect says it of itself."""
