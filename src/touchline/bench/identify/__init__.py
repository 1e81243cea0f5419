# SPDX-License-Identifier: Apache-2.0
"""Identification of real arms, judged on motion that played no part."""
