"""The search for the area of contact and the pressures."""
