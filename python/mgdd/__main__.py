"""Run the command line as `python -m mgdd`."""

from __future__ import annotations

import sys

from mgdd.cli import main

sys.exit(main())
