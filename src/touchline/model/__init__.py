# SPDX-License-Identifier: Apache-2.0
"""What the robot is: its description, its mechanism, its surfaces."""
