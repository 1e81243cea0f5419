# SPDX-License-Identifier: Apache-2.0
"""Speed and accuracy, side by side with the peers that are installed."""
