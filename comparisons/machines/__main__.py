"""What more than one core gains: threads, ranks, the arrays of a GPU."""

from comparisons.machines.parts import main

if __name__ == "__main__":
    main()
