"""Every preconditioner on areas, on symbols, and on fractional diffusion."""

from comparisons.preconditioners.parts import main

if __name__ == "__main__":
    main()
