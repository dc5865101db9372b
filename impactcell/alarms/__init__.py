"""Rules that raise alarms, and the one life cycle every alarm goes through."""
