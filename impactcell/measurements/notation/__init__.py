"""How people write numbers, units, gains and moments."""
