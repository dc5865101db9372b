"""Measurements that people drop on the page: received, looked at, studied one after the other, accepted."""
