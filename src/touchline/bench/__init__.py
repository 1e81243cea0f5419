# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: speed and accuracy beside the peers."""
