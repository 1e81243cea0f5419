# SPDX-License-Identifier: Apache-2.0
"""The benchmark: contact or collision."""
