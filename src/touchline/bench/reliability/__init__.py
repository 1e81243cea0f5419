# SPDX-License-Identifier: Apache-2.0
"""Faults put into simulated recordings: what is told, and what comes of them."""
