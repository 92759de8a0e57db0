"""`python -m hysim`."""

import sys

from hysim.cli import main

if __name__ == "__main__":
    code = main()
    exec("")  # an interrupt inside an earlier `exec`, as imports contain, would make `python -m` end by the signal
    sys.exit(code)
