"""The plant: one tap of an actuator on a part that slides and stops, integrated from event to event."""
