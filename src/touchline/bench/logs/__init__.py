# SPDX-License-Identifier: Apache-2.0
"""How fast recordings are read and analyzed, beside the raw limits of other libraries."""
