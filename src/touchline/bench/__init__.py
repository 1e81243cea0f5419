# SPDX-License-Identifier: Apache-2.0
<<<<<<< HEAD
"""Benchmarks: speed and accuracy beside the peers."""
=======
"""Speed and accuracy, side by side with the peers that are installed."""
>>>>>>> baselines
