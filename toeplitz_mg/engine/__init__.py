"""How a product is made: transforms, the memory and the threads they take, the meter of work."""
