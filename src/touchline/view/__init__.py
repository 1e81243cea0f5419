# SPDX-License-Identifier: Apache-2.0
"""Pages in the browser: the robot in three dimensions, touched live or replayed."""
