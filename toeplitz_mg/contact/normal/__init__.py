"""What finds the area of contact and the pressure on it."""
