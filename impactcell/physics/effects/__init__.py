"""Physical effects that join the nominal model; one file is one named effect."""
