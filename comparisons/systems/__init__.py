"""What is measured on: matrices by name, masks by name, flat punches."""
