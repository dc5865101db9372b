"""Where model and measurement disagree: locate, name, extend, prove."""
