"""Cases of particles that come while a scene runs."""
