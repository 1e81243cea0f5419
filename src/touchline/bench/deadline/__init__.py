# SPDX-License-Identifier: Apache-2.0
"""The benchmark: is every sample done in time?"""
