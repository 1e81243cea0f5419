# SPDX-License-Identifier: Apache-2.0
"""A small software renderer in NumPy: no OpenGL, no window, no display needed."""
