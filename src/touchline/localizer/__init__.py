# SPDX-License-Identifier: Apache-2.0
"""Where the arm is touched: link surfaces, places, candidates."""
