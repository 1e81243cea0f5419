# SPDX-License-Identifier: Apache-2.0
"""What half and double of each tuning number do, on a few simulated recordings."""
