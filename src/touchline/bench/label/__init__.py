# SPDX-License-Identifier: Apache-2.0
"""What it costs to label data sets for robot learning."""
