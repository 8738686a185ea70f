"""A contact problem by this package, `aspher`, `tamaas` and `ContactMechanics`."""

from comparisons.peers.measuring import main

if __name__ == "__main__":
    main()
