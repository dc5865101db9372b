"""`impactcell demo`: a simulated cell and the service on loopback, with a live view."""

from impactcell.demo.runner import demo

__all__ = ["demo"]
