"""``python -m toeplitz_mg``."""

import sys

from toeplitz_mg.cli.main import main

sys.exit(main())
