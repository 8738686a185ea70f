"""A campaign of random problems that looks for answers that are silently wrong."""
