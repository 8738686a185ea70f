"""``python -m toeplitz_mg``."""

import sys

from toeplitz_mg.cli import main

sys.exit(main())
