# SPDX-License-Identifier: Apache-2.0
"""Touches, motions, faults and recordings on which tests and benchmarks try the product."""
