# SPDX-License-Identifier: Apache-2.0
"""What kind of touch it is: contact or collision, zone, clamping."""
