"""Contact problems against theory."""

from comparisons.theory.cases import main

if __name__ == "__main__":
    main()
