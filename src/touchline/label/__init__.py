# SPDX-License-Identifier: Apache-2.0
"""Adds the touch channel to robot-learning data sets."""
