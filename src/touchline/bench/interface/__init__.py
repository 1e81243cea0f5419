# SPDX-License-Identifier: Apache-2.0
"""The arm as an interface, measured: handwriting, buttons, sliders, gestures, taught spots."""
