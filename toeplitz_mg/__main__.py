"""``python -m toeplitz_mg``."""

import sys

from toeplitz_mg.cli.linear import main

sys.exit(main())
