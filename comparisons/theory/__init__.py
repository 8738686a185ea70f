"""Contact, friction, rolling and stresses against theory."""
