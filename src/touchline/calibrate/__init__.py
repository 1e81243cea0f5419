# SPDX-License-Identifier: Apache-2.0
"""Noise figures and thresholds from recordings without contact."""
