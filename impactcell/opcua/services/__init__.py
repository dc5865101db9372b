"""Services that need no state of their own: attributes, methods, browsing, discovery."""
