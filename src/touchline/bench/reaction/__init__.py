# SPDX-License-Identifier: Apache-2.0
"""The benchmark: what a collision does, by the reaction."""
