# SPDX-License-Identifier: Apache-2.0
"""What the robot really is: parameters regressed from the observer's own residuals."""
