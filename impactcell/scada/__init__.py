"""OPC UA: information model, values, conditions, history and access control."""
