"""Contact of unlike materials, where pressures and tangential tractions depend on each other."""
