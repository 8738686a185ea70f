"""Every method that is at hand for a Toeplitz system, on the same systems."""

from comparisons.baselines.comparison import main

if __name__ == "__main__":
    main()
