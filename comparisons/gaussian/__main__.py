"""Likelihoods of stationary processes on a grid."""

from comparisons.gaussian.likelihood import main

if __name__ == "__main__":
    main()
