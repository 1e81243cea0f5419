# SPDX-License-Identifier: Apache-2.0
"""Many recordings of which some are damaged, while processes are killed."""
