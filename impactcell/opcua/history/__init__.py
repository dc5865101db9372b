"""HistoryRead: raw values, aggregates and events (Part 11 and 13)."""
