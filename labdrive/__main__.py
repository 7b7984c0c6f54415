"""`python -m labdrive`, and the `labdrive` command."""

import sys

from labdrive.cli import main

if __name__ == "__main__":
    sys.exit(main())
