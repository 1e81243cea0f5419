# SPDX-License-Identifier: Apache-2.0
"""Many recordings, analyzed by all cores, each accounted for once."""
