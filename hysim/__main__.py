"""`python -m hysim`."""

import sys

from hysim.cli import main

if __name__ == "__main__":
    sys.exit(main())
