"""What the workflow hands over: `result.json`, figures and one page."""
