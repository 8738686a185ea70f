"""A contact problem by this package and by others that solve the same."""
