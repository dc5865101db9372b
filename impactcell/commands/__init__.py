"""Verbs of the command line that read and write files; one file a verb."""
