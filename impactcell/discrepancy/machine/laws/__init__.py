"""A function that the catalogue does not have, where something remains: found, named by its form, proved."""
