"""What finds the tractions of friction: of a load that shifts, and of bodies that roll."""
