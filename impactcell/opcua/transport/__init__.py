"""OPC UA TCP: connections, frames, secure channels (Part 6, 6.7 and 7.1)."""
