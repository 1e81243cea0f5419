# SPDX-License-Identifier: Apache-2.0
"""The command line."""

from touchline.cli.main import main

__all__ = ["main"]
