"""Tables as records in SI units, of several recorders and groups, with what is constant in each."""
