"""`impactcell demo`: a simulated cell and the service on loopback, with a live view."""
