# SPDX-License-Identifier: Apache-2.0
"""The native core. It holds a build for each kind of processor; all give the same numbers."""

import touchline._core as core

__all__ = ["core"]
