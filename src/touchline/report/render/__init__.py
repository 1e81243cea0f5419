# SPDX-License-Identifier: Apache-2.0
"""What the native renderer draws with: cameras, skins, solids, image files."""
