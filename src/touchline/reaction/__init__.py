# SPDX-License-Identifier: Apache-2.0
"""What the arm does about a contact."""
