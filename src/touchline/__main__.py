# SPDX-License-Identifier: Apache-2.0
"""`python -m touchline` is the command line."""

import sys

from touchline.cli import main

sys.exit(main())
