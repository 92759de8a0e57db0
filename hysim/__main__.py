"""`python -m hysim`."""

import sys


def main() -> int:
    """Run the command line and return its exit code; 130 also for an interrupt while it is being loaded."""
    try:
        from hysim import cli
    except KeyboardInterrupt:
        print("hysim: interrupted", file=sys.stderr)
        return 130
    return cli.main()


if __name__ == "__main__":
    code = main()
    exec("")  # an interrupt inside an earlier `exec`, as imports contain, would make `python -m` end by the signal
    sys.exit(code)
