# SPDX-License-Identifier: Apache-2.0
"""Is the arm touched: tests of residuals, thresholds, calibration."""
