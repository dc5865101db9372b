"""Campaign directories: recorded shots on disk, read and written in one format."""
