"""What more than one core gains: threads, ranks, the arrays of a GPU."""
