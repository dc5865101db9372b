"""The command line: `app` holds the verbs, every other file is one verb or what several share."""
