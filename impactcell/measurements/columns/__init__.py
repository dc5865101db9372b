"""What each column of a table means: by its name, by what the user says, and what is constant in it."""
