"""Who asks: sessions, logins, and to whom a request goes."""
